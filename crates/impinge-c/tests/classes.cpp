// The classes of impinge.hpp: what they own, what they throw, and that their answers are those of C. With -DIMPINGE_NO_EXCEPTIONS: results.
#include "common.h"
#include <impinge/impinge.hpp>
#if __cplusplus >= 202002L
#include <span>
#endif

namespace {

ball balls[2];
std::vector<std::array<std::uint32_t, 3>> faces(const ball &of) {
  std::vector<std::array<std::uint32_t, 3>> rows(FACES);
  memcpy(rows.data(), of.faces, sizeof of.faces);
  return rows;
}
std::vector<double> numbers(const ball &of) { return {&of.positions[0][0], &of.positions[0][0] + 3 * VERTICES}; }

#ifndef IMPINGE_NO_EXCEPTIONS
using impinge::pair_kind;
using impinge::query;

template <class Call> void throws(impinge_status status, const char *text, Call call) {
  try {
    call();
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(error.status() == status);
    CHECK(strstr(error.what(), text) != nullptr);
  }
}

void answers() {
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  const auto b = scene.add_triangles(impinge::rows(&balls[1].faces[0][0], FACES), impinge::rows(&balls[1].positions[0][0], VERTICES));
  impinge::detector detector(impinge::backend::cpu);
  impinge::pairs kept;
  {
    auto pairs = detector.detect(scene);
    CHECK(pairs.size() > 100 && pairs.hash() == hash_of(detector.raw(), scene.raw(), nullptr));
    CHECK(pairs.between(a, b).size() == pairs.size() && pairs.self_of(a).empty());
    CHECK(pairs.between(b, a)[0][0] == pairs[0].element_b);
    CHECK(pairs.stats().n_candidates >= pairs.size());
    std::size_t n = 0;
    for (const auto &row : pairs) n += row.body_a == a;
    CHECK(n == pairs.size());
    kept = std::move(pairs);
  }
  CHECK(detector.count(scene, query::between(a, b)) == kept.size() && detector.any(scene));
  CHECK(!detector.any(scene, query::all().exclude(a, b)) && !detector.any(scene, query::self_all()));
  {
    // A reference keeps what setters of a temporary give.
    const auto &without = query::all().separation(0.25).exclude(a, b);
    const auto &one = impinge::settings(impinge::backend::cpu).threads(1).reuse_margin(0.5);
    CHECK(without.raw().separation == 0.25 && !detector.any(scene, without));
    CHECK(one.reuse_margin() == 0.5 && impinge::detector(one).any(scene));
  }
#if __cplusplus >= 202002L
  std::span<const impinge::pair> span = kept.rows();
  CHECK(span.size() == kept.size());
#endif
  const auto contacts = detector.contacts(scene, kept);
  CHECK(contacts.size() == kept.size() && contacts.starts().size() == kept.size() + 1 && contacts.curve_starts().size() == 2);
  CHECK(contacts.curve_lengths()[0] > 5 && contacts.points().size() > 100);
  const auto deep = detector.penetration(scene, contacts, a, b);
  CHECK(deep.size() == 1 && deep.inside_a().size() == deep[0].n_inside[0] && deep.begin()->body_b == b);

  const auto near = detector.near(scene, 0.01, query::between_all().closest_points());
  CHECK(near.size() > 100 && near.distances().size() == near.size() && near.closest_points().size() == near.size());
  CHECK(near.of(pair_kind::vf).size() + near.of(pair_kind::ee).size() + near.of(pair_kind::ef).size() == near.size());
  CHECK(near.of(pair_kind::ff).empty() && near.features().size() == near.size());
  const auto pairs_of_parts = detector.near(scene, 0.01, query::between_all().kinds({pair_kind::vf, pair_kind::ee}));
  const auto stencils = pairs_of_parts.stencils(scene);
  const auto merged = stencils.merged();
  double weight = 0;
  for (const double of : merged.weights()) weight += of;
  CHECK(merged.size() < stencils.size() && stencils.size() == pairs_of_parts.size() && weight == static_cast<double>(stencils.size()));
  CHECK(merged.hessians().size() == merged.size() && merged.gradients()[0].size() == 12 && merged.vertices().size() == merged.size());
  std::vector<double> rest = numbers(balls[0]), second = numbers(balls[1]);
  rest.insert(rest.end(), second.begin(), second.end());
  double area = 0;
  const auto by_area = pairs_of_parts.stencils_by_area(scene, rest);
  for (const double of : by_area.weights()) area += of;
  CHECK(area > 0 && area < 0.01 * weight);
  {
    // What is kept is the same row; what is gone has no other.
    const auto second_pairs = detector.near(scene, 0.005, query::between_all().kinds({pair_kind::vf, pair_kind::ee}));
    const auto changes = second_pairs.changes(pairs_of_parts);
    CHECK(changes.added().empty() && changes.kept().size() == second_pairs.size() && !changes.gone().empty() && !changes.empty());
    CHECK(changes.kept().size() + changes.gone().size() == pairs_of_parts.size());
    for (const auto &rows : changes.kept()) CHECK(memcmp(&pairs_of_parts[rows[0]], &second_pairs[rows[1]], sizeof(impinge::pair)) == 0);
    CHECK(kept.changes(kept).empty());
    // Of another scene, and of a body that was re-meshed, numbers name other elements.
    impinge::scene other;
    for (const auto &ball : balls) other.add_triangles(faces(ball), numbers(ball));
    const auto others = detector.detect(other);
    CHECK(others.size() == kept.size());
    throws(IMPINGE_ERROR_INVALID, "another scene", [&] { others.changes(kept); });
    other.remesh(a, IMPINGE_TRIANGLES, faces(balls[0]), numbers(balls[0]));
    throws(IMPINGE_ERROR_INVALID, "body 0: the pairs were found before it was re-meshed", [&] { detector.detect(other).changes(others); });
  }
  const auto candidates = detector.candidates(scene, 0.01, query::all().kinds({pair_kind::ee}));
  CHECK(candidates.of(pair_kind::ee).size() == candidates.size() && candidates.size() > 100);
  std::size_t n = 0;
  const auto given = detector.candidates_in_runs(
      scene, 0.01, 1000, [&](pair_kind, impinge::view<impinge::pair> rows) { n += rows.size(); return true; }, query::all().kinds({pair_kind::ee}));
  CHECK(given == n && n == candidates.size());
  throws(IMPINGE_ERROR_INVALID, "kinds", [&] { detector.detect(scene, query::all().kinds({pair_kind::ee})); });
  try {
    detector.candidates_in_runs(scene, 0.01, 10, [](pair_kind, impinge::view<impinge::pair>) -> bool { throw 7; });
    CHECK(!"it has thrown");
  } catch (int seven) {
    CHECK(seven == 7);
  }
}

void steps() {
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  auto far_away = std::make_shared<std::vector<double>>(numbers(balls[0]));
  for (std::size_t ix = 0; ix < far_away->size(); ix += 3) (*far_away)[ix] += 5;
  const auto b = scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  scene.lend_positions(b, far_away);
  CHECK(far_away.use_count() == 2 && scene.positions(b).data == far_away->data());
  scene.set_end_positions(b, numbers(balls[1]));
  impinge::detector detector(impinge::settings(impinge::backend::cpu).threads(1));
  const auto with = query::all().clearance(1e-3).start(impinge::start::verify).precision(impinge::precision::f64);
  const auto first = detector.earliest(scene, with);
  CHECK(first && first->body_b == b && !detector.is_free(scene, with) && detector.start_intersects() == false);
  const auto impacts = detector.impacts(scene, with);
  CHECK(impacts.of(pair_kind::vf).size() + impacts.of(pair_kind::ee).size() == impacts.size() && !impacts.empty());
  const auto advance = detector.advance(scene, with);
  CHECK(advance.fraction() > 0.5 && advance.fraction() == detector.advance_fraction(scene, with) && advance.first()->toi >= advance.fraction());
  CHECK(advance.positions(a).rows == 0 && advance.positions(b).rows == VERTICES && advance.start_intersects() == false);
  // Whatever the precision of times is, that of the first contact is rounded to double, and to float with a clearance.
  const auto exact = detector.earliest(scene, query::all().precision(impinge::precision::f64)), rounded = detector.earliest(scene);
  CHECK(exact && rounded && exact->toi > rounded->toi && detector.advance(scene).first()->toi == exact->toi);
  CHECK(static_cast<double>(static_cast<float>(advance.first()->toi)) == advance.first()->toi);
  advance.apply(scene);
  CHECK(far_away.use_count() == 1);
  // No rows are a mistake, and not the wish to stand still.
  scene.set_end_positions(b, numbers(balls[1]));
  throws(IMPINGE_ERROR_INVALID, "body 1: 0 end positions given, but it has 1154 vertices; clear_end_positions", [&] { scene.set_end_positions(b, std::vector<double>()); });
  throws(IMPINGE_ERROR_INVALID, "clear_end_positions", [&] { scene.lend_end_positions(b, std::make_shared<std::vector<double>>()); });
  throws(IMPINGE_ERROR_INVALID, "owner is NULL", [&] { scene.lend_positions(b, std::shared_ptr<std::vector<double>>()); });
  throws(IMPINGE_ERROR_INVALID, "owner is NULL", [&] { scene.lend_end_positions(b, std::shared_ptr<std::vector<double>>()); });
  throws(IMPINGE_ERROR_INVALID, "no body 9", [&] { scene.set_end_positions(9, std::vector<double>()); });
  CHECK(scene.end_positions(b).rows == VERTICES);
  scene.clear_end_positions(b);
  CHECK(scene.end_positions(b).rows == 0);
  const auto nothing = scene.add_points(std::vector<double>());
  scene.set_end_positions(nothing, std::vector<double>());
  scene.remove(nothing);
  const auto nearest = detector.distance(scene, a, b);
  CHECK(nearest && nearest->distance >= 1e-3 && nearest->distance < 1.01e-3);
  throws(IMPINGE_ERROR_INVALID, "no body 9", [&] { scene.set_positions(9, numbers(balls[0])); });
  throws(IMPINGE_ERROR_INVALID, "row_stride", [&] { scene.set_positions(a, std::vector<double>(3 * VERTICES + 1)); });
  throws(IMPINGE_ERROR_INVALID, "rows of 4 numbers given, 3 needed", [&] { scene.set_positions(a, std::vector<std::array<float, 4>>(VERTICES)); });
  // Less than one row is not no row.
  const char *no_row = "rows are not of 3 numbers each";
  const std::vector<double> two{0.1, 0.1};
  const float pair[] = {1, 2};
  const auto n_bodies = scene.n_bodies();
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { detector.contains(scene, a, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { detector.signed_distance(scene, a, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { detector.winding_numbers(scene, a, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { detector.closest(scene, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { detector.cast(scene, two, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { scene.add_points(pair); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { scene.add_triangles(std::vector<std::int32_t>{0}, std::vector<double>()); });
  throws(IMPINGE_ERROR_INVALID, "rows are not of 2 numbers each", [&] { scene.add_edges(std::vector<std::uint64_t>{0}, std::vector<double>(3)); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { scene.set_end_positions(a, two); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { scene.lend_end_positions(a, std::make_shared<std::vector<double>>(two)); });
  throws(IMPINGE_ERROR_INVALID, no_row, [&] { (void)impinge::weld(two); });
  throws(IMPINGE_ERROR_INVALID, "rows are not of 4 numbers each", [&] { scene.set_transform(a, std::vector<double>{1}); });
  CHECK(scene.n_bodies() == n_bodies && scene.end_positions(b).rows == 0 && detector.contains(scene, a, std::vector<double>()).empty());
  // Numbers that are rows of their own.
  const auto lone = scene.add_points(std::vector<float>{1, 2, 3});
  scene.set_groups(lone, std::vector<std::uint32_t>{7});
  scene.set_pinned(lone, std::vector<std::uint8_t>{1});
  scene.set_pinned(lone, std::vector<std::array<std::uint8_t, 1>>{{0}});
  throws(IMPINGE_ERROR_INVALID, "integers of 32 or 64 bits", [&] { scene.set_groups(lone, std::vector<std::uint8_t>{7}); });
  throws(IMPINGE_ERROR_INVALID, "integers of 32 or 64 bits", [&] { scene.add_edges(std::vector<std::int8_t>{0, 1}, std::vector<float>(6)); });
  throws(IMPINGE_ERROR_INVALID, "groups and positions swapped?", [&] { scene.set_groups(lone, std::vector<float>{7}); });
}

void probes() {
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  auto beside = numbers(balls[0]);
  for (std::size_t ix = 0; ix < beside.size(); ix += 3) beside[ix] += 2.1;
  const auto b = scene.add_triangles(faces(balls[0]), beside);
  impinge::detector detector(impinge::backend::cpu);
  const std::vector<std::array<float, 3>> points = {{0, 0, 0}, {0, 0, 1}, {0, 0, -3}};
  CHECK(detector.contains(scene, a, points) == (std::vector<std::int8_t>{1, 0, -1}));
  CHECK(detector.winding_numbers(scene, a, points) == (std::vector<std::int32_t>{1, IMPINGE_ON_SURFACE, 0}));
  const auto signed_ = detector.signed_distance(scene, a, points);
  CHECK(signed_[0] > 0.99 && signed_[1] == 0 && signed_[2] == -2);
  const auto closest = detector.closest(scene, points, 1.5, query::of(a));
  CHECK(closest.size() == 3 && closest[0].found == 1 && closest[2].found == 0 && closest[1].distance == 0 && closest.hash() != 0);
  CHECK(detector.closest(scene, points)[2].found == 1);
  CHECK(closest.n_nearest() == 1 && closest.of(0).size() == 1 && closest.of(2).empty() && closest.of(3).empty());
  const auto few = detector.closest(scene, points, 1.5, query::of(a).n_nearest(3));
  CHECK(few.size() == 9 && few.n_nearest() == 3 && few.of(1).size() == 3 && few.of(2).empty() && few.hash() != closest.hash());
  CHECK(few.of(1).begin() == &few[3] && few.of(1)[2].distance == 0 && few[3].element < few[4].element && few[4].element < few[5].element);
  throws(IMPINGE_ERROR_INVALID, "n_nearest: 0", [&] { detector.closest(scene, points, 1.5, query::all().n_nearest(0)); });
  const std::vector<double> corners = {0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, -4};
  const auto solid = scene.add_tetrahedra(std::vector<std::int32_t>{0, 1, 2, 3, 0, 2, 1, 4}, corners);
  const std::vector<std::array<double, 3>> where = {{1, 1, -1}, {1, 1, 0}, {3, 3, 3}};
  CHECK(detector.locate(scene, solid, where) == (std::vector<std::uint32_t>{1, 0, IMPINGE_NO_ELEMENT}));
  throws(IMPINGE_ERROR_INVALID, "tetrahedra", [&] { detector.locate(scene, a, where); });
  scene.remove(solid);
  const std::vector<double> origins = {0, 0, 5, 0, 3, 5}, down = {0, 0, -1, 0, 0, -1};
  const auto hits = detector.cast(scene, origins, down);
  CHECK(hits.n_rays() == 2 && hits.size() == 1 && hits[0].t == 4 && hits.of(0).size() == 1 && hits.of(1).empty() && hits.of(2).empty());
  CHECK(hits.is_hit()[0] == 1 && hits.is_hit()[1] == 0);
  const auto all = detector.cast(scene, origins, down, 9, query::all().hits(impinge::hits_of_ray::all));
  CHECK(all.size() == 2 * SEGMENTS && all.starts().size() == 3 && all.of(0).size() == all.size() && all.hash() != hits.hash());
  const auto any = detector.cast(scene, origins, down, 1, query::all().hits(impinge::hits_of_ray::any));
  CHECK(any.starts().empty());
  const auto nearest = detector.nearest(scene);
  CHECK(nearest && nearest->body_a == a && nearest->body_b == b && nearest->distance < 0.11);

  const auto safe = detector.safe_distances(scene, 1, query::between_all().fixed({a}));
  CHECK(static_cast<const double *>(safe.of(a).data)[0] == 0 && safe.of(b).rows == VERTICES && safe.touching().empty());
  CHECK(safe.stats().n_candidates > 0);
  const auto lists = detector.neighbours(scene, 0.2, query::between_all());
  CHECK(lists.size() > 10 && lists.vf().offsets.size() == 2 * VERTICES + 1 && lists.fv().indices.size() == lists.vf().indices.size());
  CHECK(lists.first(b)[0] == VERTICES && lists.ee().distances.size() == lists.ee().indices.size() && !lists.empty());
  const auto singles = lists.distances_f32(impinge::pair_kind::vf, true);
  CHECK(singles.size() == lists.fv().distances.size() && singles[3] <= lists.fv().distances[3] && singles[3] > 0.999 * lists.fv().distances[3]);
  const auto rest = detector.near(scene, 0.2, query::between_all());
  CHECK(detector.near(scene, 0.2, query::between_all().exclude(rest)).empty() && !rest.empty());
  {
    // A query keeps the pairs: of an answer that gets others, and of one that is gone.
    auto again = detector.near(scene, 0.2, query::between_all());
    auto without = query::between_all();
    without.exclude(again);
    again = detector.near(scene, 0, query::between_all());
    const auto copy = without;
    CHECK(detector.near(scene, 0.2, without).empty() && detector.near(scene, 0.2, copy).empty());
    CHECK(detector.near(scene, 0.2, query::between_all().exclude(detector.near(scene, 0.2, query::between_all()))).empty());
  }
  CHECK(detector.near(scene, 0.02, query::self_all().exclude_rings(3)).empty() && !detector.near(scene, 0.02, query::self_all()).empty());
  scene.set_groups(a, std::vector<std::int64_t>(VERTICES, 4));
  scene.set_groups(b, std::vector<std::uint32_t>(VERTICES, 5));
  CHECK(detector.near(scene, 0.2, query::between_all().exclude_groups(5, 4)).empty());
  scene.set_pinned(a, std::vector<std::uint8_t>(VERTICES, 1));
  scene.set_pinned(b, std::vector<std::int32_t>(VERTICES, 1));
  CHECK(detector.near(scene, 0.2, query::between_all()).empty());
  // What is pinned has a distance, all the same.
  const auto of_pinned = detector.distance(scene, a, b);
  CHECK(of_pinned && of_pinned->distance == nearest->distance && detector.nearest(scene)->distance == nearest->distance);
  scene.set_pinned(b, std::vector<std::uint8_t>(VERTICES, 0));

  {
    const std::vector<std::uint64_t> none(VERTICES + 1, 0);
    const std::vector<std::uint32_t> listed;
    CHECK(detector.near(scene, 0.2, query::between_all().exclude_vertices(a, b, none, listed)).size() == rest.size());
    scene.set_thickness(a, 0.05);
    const auto thick = detector.near(scene, 0.2, query::between_all()).size();
    scene.set_vertex_thickness(a, std::vector<double>(VERTICES, 0.05));
    CHECK(thick > rest.size() && detector.near(scene, 0.2, query::between_all()).size() == thick);
    scene.set_edge_thickness(a, std::vector<double>(scene.edges(a).rows, 0.05));
    CHECK(detector.near(scene, 0.2, query::between_all()).size() == thick);
    scene.set_face_thickness(a, std::vector<double>(scene.faces(a).rows, 0.05));
    CHECK(detector.near(scene, 0.2, query::between_all()).size() == thick);
    scene.set_thickness(a, 0);
  }

  scene.set_end_positions(b, numbers(balls[1]));
  const auto truncation = detector.truncate(scene);
  CHECK(truncation.n_cut() > 10 && truncation.n_touching() == 0 && truncation.rounds() > 0 && !truncation.start_intersects());
  CHECK(truncation.positions(b).rows == VERTICES && truncation.positions(a).rows == 0);
  const auto stopped = truncation.pairs();
  CHECK(stopped.size() > 10 && stopped.hash() != 0 && stopped.kinds().size() == stopped.size() && stopped.of(pair_kind::vf).size() > 0);
  const auto apart = detector.impacts(scene, query::between_all().separation(0.1)).size();
  scene.set_vertex_thickness(a, std::vector<double>(VERTICES, 0.0625));
  scene.set_thickness(b, 0.0375);
  CHECK(apart > 0 && detector.impacts(scene, query::between_all()).size() == apart);
  scene.set_thickness(a, 0);
  scene.set_thickness(b, 0);
  truncation.apply(scene);
  CHECK(!detector.any(scene) && impinge::devices().empty());
  throws(IMPINGE_ERROR_INVALID, "most: -1", [&] { detector.safe_distances(scene, -1); });
  throws(IMPINGE_ERROR_INVALID, "no body 9", [&] { detector.contains(scene, 9, points); });
}

// What belongs to no scene, and rows as types.
void alone() {
  const std::array<double, 3> start[] = {{0.25, 0.25, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  double end[4][3] = {{0.25, 0.25, -1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  CHECK(impinge::first_contact(pair_kind::vf, start, end) == 0.5);
  const auto kept = impinge::first_contact(pair_kind::vf, start, end, query().separation(0.5));
  CHECK(kept && *kept <= 0.25 && *kept > 0.2499);
  end[0][2] = 0.5;
  CHECK(!impinge::first_contact(pair_kind::vf, start, end));
  throws(IMPINGE_ERROR_INVALID, "start", [&] { (void)impinge::first_contact(pair_kind::ev, start, end); });

  std::vector<std::array<std::array<double, 3>, 3>> matrices{{{{1, 0, 0}, {0, -2, 0}, {0, 0, 3}}}, {{{0, 1, 0}, {1, 0, 0}, {0, 0, 0}}}};
  impinge::project_psd(matrices);
  const auto near = [](double a, double b) { return a > b - 1e-12 && a < b + 1e-12; };
  CHECK(matrices[0][1][1] == 0 && near(matrices[0][0][0], 1) && near(matrices[0][2][2], 3));
  CHECK(near(matrices[1][0][0], 0.5) && near(matrices[1][0][1], 0.5) && near(matrices[1][1][0], 0.5));
  CHECK(strcmp(impinge::version(), impinge_version()) == 0);

  impinge::scene scene;
  const float points[] = {0, 0, 0, 1, 2, 3};
  const double moved[16] = {1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const auto b = scene.add_points(points);
  const auto at = impinge::as_rows<std::array<float, 3>>(scene.positions(b));
  CHECK(at.size() == 2 && at[1][2] == 3);
  scene.set_transform(b, moved);
  CHECK((impinge::as_rows<std::array<float, 3>>(scene.positions(b))[1][0] == 6));
  throws(IMPINGE_ERROR_INVALID, "as_rows", [&] { (void)impinge::as_rows<std::array<double, 3>>(scene.positions(b)); });
  throws(IMPINGE_ERROR_INVALID, "as_rows", [&] { (void)impinge::as_rows<std::array<float, 2>>(scene.positions(b)); });
  throws(IMPINGE_ERROR_INVALID, "as_rows", [&] { (void)impinge::as_rows<float>(scene.positions(b)); });
  throws(IMPINGE_ERROR_INVALID, "stride", [&] { scene.set_transform(b, points); });
  // An end in double makes positions in float double, and so they stay until others are set.
  const auto never_moved = scene.add_points(points);
  for (const auto of : {b, never_moved}) {
    CHECK(scene.positions(of).type == IMPINGE_F32);
    scene.set_end_positions(of, std::vector<double>{0, 0, 0, 1, 2, 4});
    scene.clear_end_positions(of);
    CHECK(scene.positions(of).type == IMPINGE_F64);
    scene.set_transform(of, moved);
    CHECK(scene.positions(of).type == (of == b ? IMPINGE_F32 : IMPINGE_F64));
    scene.set_positions(of, points);
    CHECK(scene.positions(of).type == IMPINGE_F32);
  }
}

void callbacks() {
  impinge::scene scene;
  scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  int n_logged = 0;
  bool stop = false;
  impinge::detector detector(impinge::settings(impinge::backend::cpu).log([&](std::uint32_t level, const char *) { n_logged += level == IMPINGE_LOG_ERROR; }).cancelled([&] {
    if (stop) throw std::runtime_error("from a callback");
    return true;
  }));
  impinge::detector moved = std::move(detector);
  throws(IMPINGE_ERROR_CANCELLED, "cancelled", [&] { moved.detect(scene); });
  CHECK(n_logged == 1);
  stop = true;
  try {
    moved.detect(scene);
    CHECK(!"it has thrown");
  } catch (const std::runtime_error &error) {
    CHECK(strcmp(error.what(), "from a callback") == 0);
  }
  throws(IMPINGE_ERROR_DEVICE, "no GPU adapter", [] { impinge::detector none(impinge::backend::gpu); });
  // The log says where a detector works, and why not on the GPU that was named.
  std::string said;
  const auto heard = [&](std::uint32_t level, const char *message) { said = (level == IMPINGE_LOG_INFO ? "info: " : "error: ") + std::string(message); };
  const auto opened = "info: impinge " + std::string(impinge::version()) + ": a detector was opened on the CPU";
  impinge::detector on_cpu(impinge::settings(impinge::backend::cpu).log(heard));
  CHECK(said == opened);
  impinge::detector anywhere(impinge::settings().log(heard));
  CHECK(said.rfind(opened + ": ", 0) == 0 && said.find("GPU") != std::string::npos);
  try {
    impinge::detector named(impinge::settings().device("RTX").log(heard));
    CHECK(said == opened + ": this library was built without the GPU backend, so the device \"RTX\" plays no part");
  } catch (const impinge::error &error) {
    CHECK(error.status() == IMPINGE_ERROR_DEVICE && said == "error: " + std::string(error.what()) && said.find("RTX") != std::string::npos);
  }
  const std::vector<std::array<float, 3>> seam = {{0, 0, 0}, {1, 0, 0}, {0, 0, 0}};
  const auto weld = impinge::weld(seam);
  CHECK(weld.map == (std::vector<std::uint32_t>{0, 1, 0}) && weld.firsts == (std::vector<std::uint32_t>{0, 1}));
}
#endif

} // namespace

int main() {
  make_ball(&balls[0], 0);
  make_ball(&balls[1], 0.9);
#ifdef IMPINGE_NO_EXCEPTIONS
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  const auto b = scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  CHECK(a.ok() && b.ok() && *a == 0 && *b == 1);
  const auto no_detector = impinge::detector::make(impinge::settings().reuse_margin(-1));
  CHECK(!no_detector && no_detector.status() == IMPINGE_ERROR_INVALID && no_detector.message().find("reuse_margin") != std::string::npos);
  auto made = impinge::detector::make();
  CHECK(made);
  const auto any = made->any(scene), none_of_self = made->any(scene, impinge::query::self_all());
  CHECK(any.ok() && *any && none_of_self.ok() && !*none_of_self);
  const auto n = made->count(scene), n_of_self = made->count(scene, impinge::query::self_all());
  CHECK(n.ok() && *n > 100 && n_of_self.ok() && *n_of_self == 0);
  const auto first = made->earliest(scene, impinge::query::self_all());
  CHECK(first.ok() && !*first);
  const auto none = scene.set_positions(9, numbers(balls[0]));
  CHECK(!none && !none.ok() && none.status() == IMPINGE_ERROR_INVALID && none.message().find("no body 9") != std::string::npos);
  impinge::detector detector(impinge::backend::cpu);
  const auto pairs = detector.detect(scene);
  CHECK(pairs && pairs->size() > 100);
  const std::vector<double> origin(3);
  const auto places = detector.contains(scene, *a, origin);
  CHECK(places && places->size() == 1 && (*places)[0] == 1);
  const auto refused = detector.safe_distances(scene, -1);
  CHECK(!refused && refused.status() == IMPINGE_ERROR_INVALID);
  const auto gpu = impinge::detector(impinge::backend::gpu).any(scene);
  CHECK(!gpu.ok() && gpu.status() == IMPINGE_ERROR_INVALID);
  const auto no_rows = scene.set_end_positions(*a, std::vector<double>());
  CHECK(!no_rows && no_rows.status() == IMPINGE_ERROR_INVALID && no_rows.message().find("clear_end_positions") != std::string::npos);
  CHECK(scene.clear_end_positions(*a));
  const auto odd = impinge::as_rows<std::array<float, 3>>(*scene.positions(*a));
  CHECK(!odd && odd.status() == IMPINGE_ERROR_INVALID && odd.message().find("as_rows") != std::string::npos);
  const auto typed = impinge::as_rows<std::array<double, 3>>(*scene.positions(*a));
  CHECK(typed && typed->size() == VERTICES);
  return finish("classes without exceptions");
#else
  answers();
  steps();
  probes();
  callbacks();
  alone();
  return finish("classes");
#endif
}
