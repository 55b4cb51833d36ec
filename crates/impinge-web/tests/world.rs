//! The logic behind the JavaScript classes, natively; and scenes with native answers for browsers
//! and Node to reproduce.

use std::fmt::Write as _;
use std::path::Path;
use std::{fs, io};

use impinge::{
    Backend, BodyKind, Detector, Elements, PairKind, Part, Positions, Query, Real, Scene, Settings,
    SharedVertex, Start,
};
use impinge_scenes::{Model, solids, soup, surfaces};
use impinge_web::{Answer, Asker, Error, Put, Question, World, query, welded};

fn asker() -> Result<Asker, Error> {
    Asker::new(Backend::Cpu.into())
}

/// The words of a query with a scope, and nothing else said.
fn words(scope: [u32; 3]) -> [u32; 9] {
    let [which, a, b] = scope;
    [which, a, b, 0, 0, 0, 0, 0, 1]
}

const ALL: [u32; 3] = [0, 0, 0];
const NUMBERS: [f64; 10] = [0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

fn rows(asker: &mut Asker, world: &World, scope: [u32; 3]) -> Result<Vec<u32>, Error> {
    Ok(asker
        .ask(Question::Detect, world, &words(scope), &NUMBERS)?
        .rows)
}

fn add<R: Real>(world: &mut World, positions: &[R]) -> Result<u32, Error>
where
    Vec<[R; 3]>: Into<Positions>,
{
    let n = positions.len() as u32 / 3;
    let index: Vec<u32> = (0..n).collect();
    world.put(Put::Add, 0, BodyKind::Triangles, &index, positions)
}

fn put<R: Real>(world: &mut World, what: Put, body: u32, positions: &[R]) -> Result<u32, Error>
where
    Vec<[R; 3]>: Into<Positions>,
{
    world.put(what, body, BodyKind::Points, &[], positions)
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
const ACROSS: [f32; 9] = [0.25, 0.25, -1.0, 0.25, 0.25, 1.0, 2.0, 2.0, 0.0];

#[test]
fn queries_are_what_the_package_writes() -> Result<(), Error> {
    let mut world = World::new();
    let gone = add(&mut world, &TRIANGLE)?;
    let a = add(&mut world, &TRIANGLE)?;
    world.remove(gone)?;
    // It gets the first slot.
    let b = add(&mut world, &ACROSS)?;
    let mut scene = Scene::new();
    let own = scene.add_triangles(&[[0, 1, 2]], &[[0.0f32; 3]; 3])?;
    assert_eq!(query(&world, &words(ALL), &NUMBERS)?, Query::all());
    let between_all = query(&world, &words([1, 0, 0]), &NUMBERS)?;
    assert_eq!(between_all, Query::between_all());
    assert_eq!(
        query(&world, &words([2, 0, 0]), &NUMBERS)?,
        Query::self_all()
    );
    for (scope, made) in [
        ([3, a, b], Query::between(own, own)),
        ([4, b, 0], Query::self_of(own)),
        ([5, a, 0], Query::of(own)),
    ] {
        let said = query(&world, &words(scope), &NUMBERS)?;
        // Of other bodies, and so another query; but of the same sort.
        assert_ne!(said, made);
        let sort = |query: &Query| {
            format!("{query:?}")
                .split(['(', '{'])
                .nth(1)
                .map(str::to_owned)
        };
        assert_eq!(sort(&said), sort(&made));
    }
    let numbers = [0.5, 0.25, 0.125, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 0.0];
    let said = query(
        &world,
        &[0, 0, 0, 1, 2, 1, 64 | 1 | 2, 1 | 2 | 4, 1],
        &numbers,
    )?;
    let expected = Query::all()
        .shared_vertex(SharedVertex::Skip)
        .start(Start::Verify)
        .precision(impinge::Precision::F64)
        .kinds([PairKind::VertexFace, PairKind::EdgeEdge])
        .closest_points()
        .owned_by([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
        .separation(0.5)
        .clearance(impinge::Clearance::new(0.25).share(0.125));
    assert_eq!(said, expected);
    let mut asker = asker()?;
    assert_eq!(rows(&mut asker, &world, [5, a, 0])?, [b, 0, a, 0]);
    let excluded = [&words(ALL)[..], &[0, a, b]].concat();
    let answer = asker.ask(Question::Detect, &world, &excluded, &NUMBERS)?;
    assert!(answer.rows.is_empty());
    Ok(())
}

#[test]
fn numbers_of_bodies_are_not_used_again() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let a = add(&mut world, &TRIANGLE)?;
    let b = add(&mut world, &ACROSS)?;
    world.remove(a)?;
    let c = add(&mut world, &TRIANGLE)?;
    assert_eq!((a, b, c), (0, 1, 2));
    assert_eq!(world.bodies(), [b, c]);
    // The library has the new body in the slot of the old one, and so before body 1.
    assert_eq!(rows(&mut asker, &world, ALL)?, [c, 0, b, 0]);
    let said = |result: Result<u32, Error>| result.expect_err("refused").to_string();
    let error = rows(&mut asker, &world, [4, a, 0]).map(|_| 0);
    assert_eq!(
        said(error),
        "there is no body 0: 3 have been added, and 1 of them removed"
    );
    assert_eq!(
        said(put(&mut world, Put::Positions, c, &TRIANGLE[..3])),
        "body 2, in the library's words: body 0: 1 positions given, but it has 3 vertices"
    );
    let wrong = world.put(Put::Add, 0, BodyKind::Triangles, &[0, 1, 9], &TRIANGLE);
    assert_eq!(
        said(wrong),
        "body 3, in the library's words: body 2: element 0 names vertex 9, but there are 3 vertices"
    );
    Ok(())
}

#[test]
fn bodies_are_of_every_kind_and_get_new_elements() -> Result<(), Error> {
    let mut world = World::new();
    let points = world.put(Put::Add, 0, BodyKind::Points, &[], &TRIANGLE)?;
    let edges = world.put(Put::Add, 0, BodyKind::Edges, &[0, 1, 1, 2], &TRIANGLE)?;
    assert_eq!(world.index(points, Part::Given)?, [0, 1, 2]);
    assert_eq!(world.body(edges)?.elements().len(), 2);
    let four = [TRIANGLE.to_vec(), vec![0.0, 0.0, 1.0]].concat();
    world.put(
        Put::Remesh,
        edges,
        BodyKind::Tetrahedra,
        &[0, 1, 2, 3],
        &four,
    )?;
    assert_eq!(world.index(edges, Part::Given)?, [0, 1, 2, 3]);
    assert_eq!(world.index(edges, Part::Edges)?.len(), 12);
    assert_eq!(world.index(edges, Part::Faces)?.len(), 12);
    let mut turn = [0.0; 16];
    for (at, x) in [(0, 1.0), (5, 1.0), (10, 1.0), (15, 1.0), (12, 8.0)] {
        turn[at] = x;
    }
    world.set_transform(points, &turn)?;
    let body = world.body(points)?;
    assert_eq!(body.positions().point(1), [9.0, 0.0, 0.0]);
    assert_eq!(body.rest_positions().point(1), [1.0, 0.0, 0.0]);
    turn[12] = 2.0;
    world.set_end_transform(points, &turn)?;
    let end = world.body(points)?.end_positions().expect("set");
    assert_eq!(end.point(1), [3.0, 0.0, 0.0], "from rest");
    put(&mut world, Put::EndPositions, points, &TRIANGLE)?;
    assert!(world.body(points)?.end_positions().is_some());
    world.clear_end_positions(points)?;
    assert!(world.body(points)?.end_positions().is_none());
    world.set_thickness(points, 0.5)?;
    assert_eq!(world.body(points)?.thickness(), 0.5);
    let n = world.body(points)?.n_vertices();
    world.set_element_thickness(points, 0, &vec![0.25; n])?;
    assert_eq!(world.body(points)?.thickness(), 0.25);
    let refused = world.set_element_thickness(points, 1, &[1.0]);
    let refused = refused.expect_err("points have no edges").to_string();
    assert_eq!(
        refused,
        "body 0: 1 thicknesses given, but there are 0 edges"
    );
    world.set_filter(points, 2, 4)?;
    assert_eq!(world.body(points)?.filter().mask, 4);
    Ok(())
}

#[test]
fn answers_about_steps() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let gone = add(&mut world, &TRIANGLE)?;
    let a = add(&mut world, &TRIANGLE)?;
    world.remove(gone)?;
    let lifted = [0.0, 0.0, 1.0, 0.25, 0.0, 1.0, 0.0, 0.25, 1.0f64];
    let b = add(&mut world, &lifted)?;
    let sunk = lifted.map(|x| if x >= 1.0 { -3.0 } else { x });
    let all = words(ALL);
    assert_eq!(
        asker.ask(Question::IsFree, &world, &all, &NUMBERS)?.numbers,
        [1.0]
    );
    put(&mut world, Put::EndPositions, b, &sunk)?;
    let impacts = asker.ask(Question::Impacts, &world, &all, &NUMBERS)?;
    // The vertices of b meet the face of a. The library calls b body 0, so a pair has b first
    // wherever kinds are alike.
    assert_eq!(impacts.rows[..4], [b, 0, a, 0]);
    let n = impacts.rows.len() / 4;
    assert_eq!(impacts.numbers, vec![0.25; n]);
    assert_eq!((impacts.bytes.len(), impacts.bytes[2 * n]), (2 * n + 1, 2));
    let verify = [0, 0, 0, 0, 2, 1, 0, 0, 1];
    let advance = asker.ask(Question::Advance, &world, &verify, &NUMBERS)?;
    let [1, moving, 9, ref start @ ..] = advance.words[..] else {
        panic!("one body moves, of two: {:?}", advance.words);
    };
    assert_eq!((advance.rows.len(), moving), (4, b));
    assert_eq!((advance.bytes[2], advance.positions.len()), (0, 1));
    let mut taken = world.clone();
    let reached = || advance.positions.clone();
    taken.take_step(start, &[b], reached())?;
    assert_eq!(taken.body(b)?.positions(), &advance.positions[0]);
    // Once is enough. The library's number of this body is another one.
    let again = taken.take_step(start, &[b], reached());
    let again = again.expect_err("somewhere else").to_string();
    let text = format!("body {b}, in the library's words: body 0: this was found for other");
    assert!(again.starts_with(&text), "{again}");
    let of_another = [&[start[0] + 1], &start[1..]].concat();
    let foreign = world.clone().take_step(&of_another, &[b], reached());
    assert!(matches!(foreign, Err(Error::StepOfAnotherModule)));
    taken.remove(b)?;
    let gone = taken.take_step(start, &[b], reached());
    assert!(matches!(gone, Err(Error::NoBody { number, .. }) if number == b));
    let [toi, fraction, n_tried] = advance.numbers[..] else {
        panic!("three numbers");
    };
    assert!(toi == 0.25 && (0.2499..=0.25).contains(&fraction) && n_tried >= 1.0);
    let mut near = NUMBERS;
    near[0] = 0.5;
    let skip = [0, 0, 0, 0, 1, 1, 0, 0, 1];
    let earliest = asker.ask(Question::Earliest, &world, &skip, &near)?;
    assert_eq!(earliest.numbers, [0.125]);
    Ok(())
}

#[test]
fn answers_about_distances_and_contacts() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let a = add(&mut world, &TRIANGLE)?;
    let b = add(&mut world, &TRIANGLE.map(|x| x + 0.5))?;
    let mut numbers = NUMBERS;
    numbers[9] = 0.5;
    let points = [0, 0, 0, 0, 0, 0, 0, 2, 1];
    let near = asker.ask(Question::Near, &world, &points, &numbers)?;
    let n = near.rows.len() / 4;
    assert!(n > 0);
    assert_eq!((near.bytes.len(), near.numbers.len()), (4 * n, 7 * n));
    let candidates = asker.ask(Question::Candidates, &world, &words(ALL), &numbers)?;
    assert!(candidates.bytes.is_sorted() && candidates.bytes.len() >= n);
    let nearest = asker.ask(Question::Distance, &world, &[b, a], &NUMBERS)?;
    assert_eq!(nearest.rows, [b, 0, a, 0]);
    assert_eq!(nearest.numbers[..1], [0.5]);

    // Two tetrahedra, as closed surfaces: the tip of one is in the other.
    let faces = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3];
    let solid = [
        0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0,
    ];
    let moved: Vec<f32> = solid
        .as_chunks::<3>()
        .0
        .iter()
        .flat_map(|[x, y, z]| [x + 0.1, y + 0.125, z - 0.875])
        .collect();
    let (mut world, gone) = (World::new(), 0);
    add(&mut world, &TRIANGLE)?;
    let low = world.put(Put::Add, 0, BodyKind::Triangles, &faces, &solid)?;
    world.remove(gone)?;
    // It is the first for the library.
    let tip = world.put(Put::Add, 0, BodyKind::Triangles, &faces, &moved)?;
    let pairs = rows(&mut asker, &world, ALL)?;
    let asked = |flags: u32| {
        let mut words = words(ALL);
        words[7] = flags;
        words
    };
    let about = |number: u32, bodies: &[u32], rows: &[u32]| {
        [&[9], &asked(0)[..], &[number], bodies, rows].concat()
    };
    let contacts = asker.ask(Question::Contacts, &world, &about(7, &[], &pairs), &NUMBERS)?;
    let n = pairs.len() / 4;
    assert_eq!(contacts.bytes[..n], vec![3; n], "segments");
    assert_eq!(contacts.bytes[2 * n..], [1, 1], "one loop with a direction");
    assert_eq!(contacts.words[0] as usize, n + 1);
    let ask = |asker: &mut Asker, number| {
        let words = about(number, &[low, tip], &pairs);
        asker.ask(Question::Penetration, &world, &words, &NUMBERS)
    };
    let known = ask(&mut asker, 7)?;
    assert_eq!(known.rows, [tip, low]);
    assert_eq!(known.words[..2], [1, 3], "the tip");
    assert!(known.numbers.len() == 22 && known.numbers[0] > 0.0);
    // Contacts that are not the last ones are found again.
    assert_eq!(ask(&mut asker, 8)?, known);
    // What the pairs of a cell have in common is not what the bodies have.
    let words = [&[9], &asked(4)[..], &[9, low, tip], &pairs].concat();
    let mut numbers = NUMBERS;
    numbers[6..9].fill(10.0);
    let of_cell = asker.ask(Question::Penetration, &world, &words, &numbers);
    assert_eq!(
        of_cell.expect_err("a cell").to_string(),
        "contacts: without some of the two, because of a cell, given, those of all pairs of the two allowed"
    );
    // A query may name bodies that were removed since.
    let extra = add(&mut world, &TRIANGLE.map(|x| x + 9.0))?;
    let asked = [&asked(1 << 5)[..], &[extra, 0, extra, tip]].concat();
    let pairs = asker.ask(Question::Detect, &world, &asked, &NUMBERS)?.rows;
    world.remove(extra)?;
    let words = [&[13], &asked[..], &[10], &pairs].concat();
    let again = asker.ask(Question::Contacts, &world, &words, &NUMBERS)?;
    assert_eq!(again.bytes, contacts.bytes);
    let words = about(9, &[], &[tip, 0, low, 4]);
    let foreign = asker.ask(Question::Contacts, &world, &words, &NUMBERS);
    assert_eq!(
        foreign.expect_err("no face 4").to_string(),
        "pairs: row 0: 0, 0, 1, 4 given, sorted rows of elements of the scene allowed"
    );
    Ok(())
}

/// Two tetrahedra that share a face.
#[test]
fn points_are_located_in_tetrahedra() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let corners = [
        0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, -4.0f32,
    ];
    let index = [0, 1, 2, 3, 0, 2, 1, 4];
    let solid = world.put(Put::Add, 0, BodyKind::Tetrahedra, &index, &corners)?;
    let points = [1.0, 1.0, -1.0, 1.0, 1.0, 0.0, 3.0, 3.0, 3.0];
    let given = [&NUMBERS[..], &points].concat();
    let answer = asker.ask(Question::Locate, &world, &[solid], &given)?;
    assert_eq!(answer.words, [1, 0, u32::MAX]);
    let ragged = asker.ask(Question::Locate, &world, &[solid], &given[..12]);
    let text = ragged.expect_err("two numbers").to_string();
    assert_eq!(text, "points: 2 numbers given, not a multiple of 3");
    Ok(())
}

/// Groups, pinned vertices, pairs at rest and runs, beside the library.
#[test]
fn what_is_left_out_is_what_the_library_leaves_out() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let gone = add(&mut world, &TRIANGLE)?;
    let below = add(&mut world, &TRIANGLE)?;
    world.remove(gone)?;
    let lifted = TRIANGLE.map(|x| if x == 0.0 { 0.25 } else { x });
    let above = add(&mut world, &lifted)?;
    let mut numbers = NUMBERS;
    numbers[9] = 1.0;
    let near = |asker: &mut Asker, world: &World, excluded: &[u32]| {
        let words = [&words(ALL), excluded].concat();
        Ok::<_, Error>(
            asker
                .ask(Question::Near, world, &words, &numbers)?
                .rows
                .len()
                / 4,
        )
    };
    let all = near(&mut asker, &world, &[])?;
    assert!(all > 4);
    world.set_groups(below, &[1, 1, 1])?;
    world.set_groups(above, &[2, 2, 3])?;
    let some = near(&mut asker, &world, &[2, 2, 1])?;
    assert!(0 < some && some < all);
    // What has vertices of two groups is in neither.
    assert!(near(&mut asker, &world, &[2, 2, 1, 2, 1, 3])? < some);
    assert_eq!(near(&mut asker, &world, &[2, 7, 9])?, all);
    let n = world.keep_at_rest(5, 1.0)?;
    assert_eq!(n as usize, all);
    assert_eq!(near(&mut asker, &world, &[3, 5, 0])?, 0);
    let refused = near(&mut asker, &World::new(), &[3, 5, 0]).expect_err("another scene");
    assert!(refused.to_string().starts_with("exclude: pairs given"));
    assert_eq!(world.keep_at_rest(6, 1.0)?, n);
    world.forget_pairs(5);
    world.forget_pairs(5);
    let refused = near(&mut asker, &world, &[3, 5, 0]).expect_err("forgotten");
    assert!(refused.to_string().contains("disposed of"), "{refused}");
    assert_eq!(near(&mut asker, &world, &[3, 6, 0])?, 0);
    // Listed pairs of vertices: all of the lower triangle with all of the upper one.
    world.keep_vertex_pairs(
        7,
        [below, above],
        &[0, 3, 6, 9],
        &[0, 1, 2, 2, 1, 0, 0, 2, 1],
    )?;
    assert_eq!(near(&mut asker, &world, &[3, 7, 0])?, 0);
    world.keep_vertex_pairs(8, [below, above], &[0, 1, 1, 1], &[0])?;
    let some = near(&mut asker, &world, &[3, 8, 0])?;
    assert!(0 < some && some < all);
    world.keep_vertex_pairs(9, [below, above], &[0, 1, 1], &[0])?;
    let refused = near(&mut asker, &world, &[3, 9, 0]).expect_err("one offset is missing");
    assert!(refused.to_string().contains("3 offsets"), "{refused}");
    assert!(
        world
            .keep_vertex_pairs(9, [below, 77], &[0, 1, 1, 1], &[0])
            .is_err()
    );
    world.set_pinned(below, &[1, 1, 1])?;
    assert_eq!(near(&mut asker, &world, &[])?, all);
    world.set_pinned(above, &[1, 1, 1])?;
    assert_eq!(near(&mut asker, &world, &[])?, 0);
    // Pairs at rest are those of positions, whatever is pinned or filtered.
    world.set_filter(above, 1, 0)?;
    assert_eq!(world.keep_at_rest(7, 1.0)?, n);
    world.set_filter(above, 1, u64::MAX)?;
    world.set_pinned(above, &[0, 0, 0])?;
    assert_eq!(near(&mut asker, &world, &[])?, all);
    assert_eq!(near(&mut asker, &world, &[3, 7, 0])?, 0);
    let said = |result: Result<(), Error>| result.expect_err("refused").to_string();
    // In the library the second one added is body 0.
    let text = said(world.set_groups(above, &[1, 2]));
    assert!(
        text.starts_with("body 2, in the library's words: ") && text.contains("groups"),
        "{text}"
    );
    let text = said(world.set_edges(above, &[0, 1, 2, 0, 1, 0]));
    assert!(
        text.starts_with("body 2, in the library's words: ")
            && text.ends_with("row 2 of edges has vertices 1 and 0, as row 0 has"),
        "{text}"
    );
    let text = said(world.set_edges(above, &[0, 1, 2]));
    assert_eq!(text, "edges: 3 numbers given, not a multiple of 2");
    world.set_edges(above, &[2, 1, 0, 1, 2, 0])?;
    assert_eq!(world.index(above, Part::Edges)?, [2, 1, 0, 1, 2, 0]);
    world.set_edges(above, &[])?;
    assert_eq!(world.index(above, Part::Edges)?, [0, 1, 0, 2, 1, 2]);
    let text = said(world.set_pinned(below, &[1, 0, 0, 1]));
    assert!(
        text.starts_with("body 1: ") && text.contains("pinned"),
        "{text}"
    );

    let whole = asker.ask(Question::Candidates, &world, &words(ALL), &numbers)?;
    let asked = (&words(ALL)[..], &numbers[..]);
    let (mut rows, mut kinds, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    let n = asker.candidates_in_runs(&world, asked, 4, |run| {
        lengths.push(run.bytes.len());
        rows.extend(run.rows);
        kinds.extend(run.bytes);
        true
    })?;
    assert_eq!((rows, kinds), (whole.rows, whole.bytes.clone()));
    assert_eq!(n, whole.bytes.len() as f64);
    assert!(lengths.len() > 2 && lengths.iter().all(|&n| 0 < n && n <= 4));
    let n = asker.candidates_in_runs(&world, asked, 4, |_| false)?;
    assert_eq!(n, 4.0);
    let refused = asker.candidates_in_runs(&world, asked, 0, |_| true);
    assert!(
        refused
            .expect_err("none")
            .to_string()
            .starts_with("most: 0")
    );
    Ok(())
}

#[test]
fn vertices_at_one_position_are_welded() -> Result<(), Error> {
    let seam = [TRIANGLE, TRIANGLE.map(|x| -x)].concat();
    assert_eq!(welded(&seam)?, [0, 1, 2, 0, 3, 4]);
    assert!(welded(&seam[1..]).is_err());
    Ok(())
}

#[test]
fn bad_input_is_refused_by_name() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    let a = add(&mut world, &TRIANGLE)?;
    let said = |result: Result<u32, Error>| result.expect_err("refused").to_string();
    let triangles = |world: &mut World, index: &[u32], positions: &[f32]| {
        world.put(Put::Add, 0, BodyKind::Triangles, index, positions)
    };
    assert_eq!(
        said(triangles(&mut world, &[0, 1, 2, 0], &TRIANGLE)),
        "index: 4 numbers given, not a multiple of 3"
    );
    assert_eq!(
        said(triangles(&mut world, &[0, 1, 2], &TRIANGLE[..8])),
        "positions: 8 numbers given, not a multiple of 3"
    );
    let mut not_a_number = TRIANGLE;
    not_a_number[4] = f32::NAN;
    let refused = said(put(&mut world, Put::Positions, a, &not_a_number));
    assert!(
        refused.starts_with("body 0: vertex 1 has a non-finite"),
        "{refused}"
    );
    let mut ask = |question, words: &[u32], numbers: &[f64; 10]| {
        let answer: Result<Answer, Error> = asker.ask(question, &world, words, numbers);
        let error = answer.expect_err("refused");
        (error.code(), error.to_string())
    };
    let mut negative = NUMBERS;
    negative[0] = -1.0;
    assert_eq!(
        ask(Question::Impacts, &words(ALL), &negative).1,
        "separation: -1 given, a finite number that is not below 0 allowed"
    );
    let kinds = [0, 0, 0, 0, 0, 0, 64 | 1, 0, 1];
    let (code, text) = ask(Question::Detect, &kinds, &NUMBERS);
    assert!(code == "invalid" && text.starts_with("kinds: "), "{text}");
    let (_, text) = ask(
        Question::Impacts,
        &[0, 0, 0, 0, 0, 0, 64 | 16, 0, 1],
        &NUMBERS,
    );
    assert_eq!(
        text,
        "kinds: ef given, in a step only vf, ee, ev and vv allowed"
    );
    let (_, text) = ask(Question::Advance, &[0, 0, 0, 0, 0, 0, 0, 4, 1], &NUMBERS);
    assert!(text.starts_with("owned_by: "), "{text}");
    assert_eq!(ask(Question::Detect, &[], &NUMBERS).0, "invalid");
    // The refused calls changed nothing.
    assert!(rows(&mut asker, &world, [4, a, 0])?.is_empty());
    assert_eq!(world.body(a)?.n_vertices(), 3);
    let mut limited = Asker::new(Settings::from(Backend::Cpu).max_pairs(Some(0)))?;
    add(&mut world, &ACROSS)?;
    let error = rows(&mut limited, &world, ALL).expect_err("one pair");
    assert_eq!(error.code(), "too_many_pairs");
    Ok(())
}

/// Bodies and how self-collision is asked for.
fn scenes() -> Vec<(&'static str, Vec<Model>, SharedVertex)> {
    let ball = surfaces::ball(15_000);
    let moved = ball.translated([0.5, 0.25, 0.125]);
    let knot = surfaces::stand_in(4_000);
    let crossed = knot.translated([0.125, 0.25, 0.0625]);
    let solid = solids::solid_ball(3_000);
    let beside = solid.translated([0.75, 0.25, 0.0]);
    vec![
        ("two balls", vec![ball, moved], SharedVertex::Skip),
        ("two knots", vec![knot, crossed], SharedVertex::Resolve),
        ("two solids", vec![solid, beside], SharedVertex::Skip),
        (
            "a soup on a lattice",
            vec![soup::lattice_web(600, 6, 1)],
            SharedVertex::Resolve,
        ),
    ]
}

fn numbers<T: std::fmt::Display>(numbers: impl IntoIterator<Item = T>) -> String {
    let mut text = String::from("[");
    for (ix, number) in numbers.into_iter().enumerate() {
        let comma = if ix > 0 { "," } else { "" };
        // Writing to a string cannot fail.
        let _ = write!(text, "{comma}{number}");
    }
    text + "]"
}

/// Where bodies are at the end of the step. Not an affine motion, so that bodies meet themselves
/// too.
fn end_of(ix: usize, position: [f32; 3]) -> [f32; 3] {
    let sign = if ix.is_multiple_of(2) { 0.25 } else { -0.25 };
    let [x, y, z] = position;
    [x + sign, y - sign * x, z + sign * x * y]
}

/// `web/test` reads `target/tmp/web-scenes.json` and expects the answers of this run.
#[test]
fn scenes_are_written_for_browsers_with_the_native_answer() -> Result<(), Box<dyn std::error::Error>>
{
    let mut written = Vec::new();
    let mut n_of_neighbours = 0;
    for (name, models, rule) in scenes() {
        let mut scene = Scene::new();
        let mut bodies = Vec::new();
        for (ix, model) in models.iter().enumerate() {
            let id = model.add_to(&mut scene)?;
            let body = scene.body(id)?;
            let Positions::F32(positions) = body.positions() else {
                return Err(io::Error::other("models are in single precision").into());
            };
            let (corners, index) = match body.elements() {
                Elements::Triangles(faces) => (3, numbers(faces.as_flattened())),
                Elements::Tetrahedra(tets) => (4, numbers(tets.as_flattened())),
                _ => return Err(io::Error::other("models are triangles or tetrahedra").into()),
            };
            let end: Vec<[f32; 3]> = positions.iter().map(|&p| end_of(ix, p)).collect();
            // Every f32 is written so that it is read as the same f32.
            let (start, finish) = (
                numbers(positions.as_flattened()),
                numbers(end.as_flattened()),
            );
            bodies.push(format!(
                "{{\"corners\":{corners},\"index\":{index},\"positions\":{start},\"end\":{finish}}}"
            ));
            scene.set_end_positions(id, &end)?;
        }
        let mut detector = Detector::new(Backend::Cpu)?;
        let query = Query::all().shared_vertex(rule);
        let skip = query.clone().shared_vertex(SharedVertex::Skip);
        let skipped = detector.detect(&scene, &skip)?.len();
        let pairs = detector.detect(&scene, &query)?;
        assert!(!pairs.is_empty(), "{name} has no pair");
        let (n_pairs, hash) = (pairs.len(), pairs.hash());
        n_of_neighbours += n_pairs - skipped.min(n_pairs);
        let impacts = detector.impacts(&scene, &query)?;
        let first = impacts
            .iter()
            .find(|impact| !impact.at_start)
            .ok_or("nothing starts to touch")?;
        let (kind, toi) = (first.kind.name(), first.toi);
        let (n_impacts, impacts_hash) = (impacts.len(), impacts.hash());
        let rule = rule.name();
        let bodies = bodies.join(",");
        written.push(format!(
            "{{\"name\":\"{name}\",\"sharedVertex\":\"{rule}\",\"pairs\":{n_pairs},\"hash\":\"{hash:016x}\",\
             \"impacts\":{n_impacts},\"impactsHash\":\"{impacts_hash:016x}\",\
             \"first\":{{\"kind\":\"{kind}\",\"toi\":{toi}}},\"bodies\":[{bodies}]}}"
        ));
    }
    assert!(n_of_neighbours > 0, "both rules have the same answers");
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("web-scenes.json");
    fs::write(file, format!("[{}]", written.join(",\n")))?;
    Ok(())
}

#[test]
fn points_rays_and_bounds_are_those_of_the_library() -> Result<(), Error> {
    let (mut world, mut asker) = (World::new(), asker()?);
    // The second body gets the first slot, and so other numbers than the library's.
    let gone = add(&mut world, &TRIANGLE)?;
    let ball = surfaces::ball(500);
    let at: Vec<f32> = ball.positions.as_flattened().to_vec();
    let index: Vec<u32> = match &ball.elements {
        Elements::Triangles(faces) => faces.as_flattened().to_vec(),
        _ => panic!("a ball has faces"),
    };
    let kind = BodyKind::Triangles;
    let a = world.put(Put::Add, 0, kind, &index, &at)?;
    world.remove(gone)?;
    let beside: Vec<f32> = at
        .iter()
        .enumerate()
        .map(|(ix, x)| x + [2.1, 0.0, 0.0][ix % 3])
        .collect();
    let b = world.put(Put::Add, 0, kind, &index, &beside)?;
    let mut scene = Scene::new();
    let own_b = scene.add_triangles(index.as_chunks().0, beside.as_chunks().0)?;
    let own_a = scene.add_triangles(index.as_chunks().0, at.as_chunks().0)?;
    let mut detector = Detector::new(Backend::Cpu)?;
    let all = Query::all();
    let points = [[0.25, 0.5, 0.125], [2.0, 0.25, 0.5], [9.0, 9.0, 9.0]];
    let with = |length: f64, points: &[[f64; 3]]| {
        let mut numbers = NUMBERS;
        numbers[9] = length;
        [&numbers[..], points.as_flattened()].concat()
    };

    let answer = asker.ask(Question::Contains, &world, &[a], &with(0.0, &points))?;
    let places = detector.contains(&scene, own_a, &points)?;
    assert_eq!(
        answer.bytes,
        places.iter().map(|&x| x as u8).collect::<Vec<_>>()
    );

    let answer = asker.ask(Question::Closest, &world, &words(ALL), &with(5.0, &points))?;
    let closest = detector.closest(&scene, &points, 5.0, &all)?;
    let number = |body| if body == own_a { a } else { b };
    for (ix, found) in closest.iter().enumerate() {
        let row = found.map(|of| [number(of.element.body), of.element.element]);
        assert_eq!(
            answer.rows[2 * ix..2 * ix + 2],
            row.unwrap_or([u32::MAX; 2])
        );
        assert_eq!(
            answer.numbers[ix],
            found.map_or(f64::INFINITY, |of| of.distance)
        );
    }
    assert_eq!(answer.bytes[2], u8::MAX);
    assert_eq!(answer.hash, closest.hash());

    let mut few = words(ALL);
    few[8] = 3;
    let answer = asker.ask(Question::Closest, &world, &few, &with(5.0, &points))?;
    let closest = detector.closest(&scene, &points, 5.0, &all.clone().n_nearest(3))?;
    assert_eq!((answer.hash, answer.bytes.len()), (closest.hash(), 9));
    assert!(answer.bytes[6..].iter().all(|&feature| feature == u8::MAX));
    let distances = closest.iter().flatten().map(|of| of.distance);
    assert!(distances.eq(answer.numbers[..6].iter().copied()));
    few[8] = 0;
    let refused = asker.ask(Question::Closest, &world, &few, &with(5.0, &points));
    let text = refused.expect_err("none asked for").to_string();
    assert!(text.starts_with("n_nearest: 0 given"), "{text}");

    let around = [[0.25, 0.125, 0.25], points[1]];
    let answer = asker.ask(Question::SignedDistance, &world, &[a], &with(0.0, &around))?;
    let closest = detector.closest(&scene, &around, f64::INFINITY, &Query::of(own_a))?;
    let places = detector.contains(&scene, own_a, &around)?;
    let signed = closest.iter().flatten().zip(&places);
    let signed = signed.map(|(of, &place)| of.distance * f64::from(place));
    assert!(signed.eq(answer.numbers.iter().copied()));
    assert!(answer.numbers[0] > 0.0 && answer.numbers[1] < 0.0);
    let refused = asker.ask(Question::Locate, &world, &[a], &with(0.0, &points));
    let text = refused.expect_err("no tetrahedra").to_string();
    assert!(text.contains("tetrahedra are needed"), "{text}");

    let rays = [
        [0.1, 0.2, 5.0],
        [2.0, 0.25, 5.0],
        [0.0, 0.0, -1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut every = words(ALL);
    every[7] = 2 << 3;
    let answer = asker.ask(Question::Cast, &world, &every, &with(f64::INFINITY, &rays))?;
    let query = Query::all().hits(impinge::Hit::All);
    let hits = detector.cast(&scene, &rays[..2], &rays[2..], f64::INFINITY, &query)?;
    assert!(
        hits.is_hit()
            .iter()
            .map(|&is| u8::from(is))
            .eq(answer.bytes[..2].iter().copied())
    );
    assert!(hits.is_hit()[0]);
    assert_eq!(answer.rows.len(), 2 * hits.iter().len());
    assert!(
        hits.iter()
            .map(|hit| hit.t)
            .eq(answer.numbers[..hits.iter().len()].iter().copied())
    );
    let offsets: Vec<u32> = hits.offsets().iter().map(|&ix| ix as u32).collect();
    assert_eq!(answer.words, [&[3], &offsets[..]].concat());

    let mut fixed = [&words([1, 0, 0])[..], &[a]].concat();
    fixed[7] = 1 << 5;
    let answer = asker.ask(Question::SafeDistances, &world, &fixed, &with(1.0, &[]))?;
    let query = Query::between_all().fixed([own_a]);
    let safe = detector.safe_distances(&scene, 1.0, &query)?;
    let n = ball.positions.len() as u32;
    assert_eq!(answer.words, [b, n, 0, a, n, 0]);
    let bounds = safe.of(own_b).expect("a body");
    assert!((0..n as usize).all(|ix| answer.numbers[ix] == bounds.get(ix)));
    assert!(
        answer.numbers[n as usize..]
            .iter()
            .all(|&bound| bound == 0.0)
    );

    let ringed = [&words(ALL)[..], &[1, 2, 0]].concat();
    let answer = asker.ask(Question::Neighbours, &world, &ringed, &with(1.3, &[]))?;
    let query = Query::all().exclude(impinge::Exclusion::rings(2));
    let near = detector.neighbours(&scene, 1.3, &query)?;
    assert!(!near.is_empty() && answer.numbers[0] == near.len() as f64);
    assert_eq!(answer.words[..5], [8, b, 0, 0, 0]);
    let vf = &near.vf().distances;
    assert_eq!(&answer.numbers[1..=vf.len()], vf);

    let answer = asker.ask(Question::Nearest, &world, &words([1, 0, 0]), &NUMBERS)?;
    let nearest = detector
        .nearest(&scene, &Query::between_all())?
        .expect("two");
    assert_eq!(answer.rows, [b, nearest.a.element, a, nearest.b.element]);
    assert_eq!(answer.numbers[0], nearest.distance);

    let end = beside;
    put(&mut world, Put::EndPositions, a, &end)?;
    scene.set_end_positions(own_a, end.as_chunks::<3>().0.to_vec())?;
    let answer = asker.ask(Question::Truncate, &world, &words(ALL), &NUMBERS)?;
    let truncation = detector.truncate(&scene, &all)?;
    assert!(truncation.n_cut() > 0);
    assert_eq!(answer.numbers[0], truncation.n_cut() as f64);
    let pairs = truncation.pairs();
    let kinds = pairs.iter().map(|(kind, ..)| kind as u8);
    assert_eq!(answer.bytes, Vec::from_iter(kinds.chain([2])));
    assert_eq!(answer.rows.len(), 4 * pairs.len());
    assert_eq!(answer.hash, pairs.hash());
    assert_eq!(answer.words[..2], [1, a]);
    assert_eq!(Some(&answer.positions[0]), truncation.positions(own_a));
    Ok(())
}
