//! Kernels without a GPU: each one parses, validates, and agrees with the host on its bindings.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};

use super::buffers::Access;
use super::kernels::*;
use super::layout::*;
use super::pipeline::Source;
use crate::bvh::grid;

fn parse(source: &Source) -> Module {
    let text = source.text();
    let module = naga::front::wgsl::parse_str(&text)
        .unwrap_or_else(|error| panic!("{}: {}", source.name, error.emit_to_string(&text)));
    Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap_or_else(|error| panic!("{}: {}", source.name, error.emit_to_string(&text)));
    module
}

#[test]
fn kernels_are_valid_and_bind_what_the_host_binds() {
    for (source, entries) in ALL {
        let module = parse(source);
        let bound: Vec<_> = module
            .global_variables
            .iter()
            .filter_map(|(_, variable)| Some((variable.binding?, variable)))
            .collect();
        assert_eq!(bound.len(), entries.len(), "{}", source.name);
        let n_storage = bound
            .iter()
            .filter(|(_, variable)| matches!(variable.space, AddressSpace::Storage { .. }))
            .count();
        assert!(n_storage <= 8, "{} binds {n_storage} buffers", source.name);
        for (binding, variable) in bound {
            let entry = &entries[binding.binding as usize];
            let name = variable.name.as_deref().unwrap_or_default();
            assert_eq!((binding.group, name), (0, entry.name), "{}", source.name);
            let access = match variable.space {
                AddressSpace::Uniform => Access::Uniform,
                AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => {
                    Access::Write
                }
                AddressSpace::Storage { .. } => Access::Read,
                space => panic!("{}: {name} is in {space:?}", source.name),
            };
            assert_eq!(access, entry.access, "{}: {name}", source.name);
            let stride = match module.types[variable.ty].inner {
                TypeInner::Array { stride, .. } => stride,
                TypeInner::Struct { span, .. } => span,
                ref other => panic!("{}: {name} is {other:?}", source.name),
            };
            assert_eq!(u64::from(stride), entry.stride, "{}: {name}", source.name);
        }
    }
}

#[test]
fn workgroups_keep_to_what_every_device_has() {
    for (source, _) in ALL {
        let module = parse(source);
        let [entry] = &module.entry_points[..] else {
            panic!("{} has one entry point", source.name);
        };
        let [x, y, z] = entry.workgroup_size;
        assert!(x * y * z <= 256, "{}", source.name);
        let shared: u32 = module
            .global_variables
            .iter()
            .filter(|(_, variable)| variable.space == AddressSpace::WorkGroup)
            .map(|(_, variable)| match module.types[variable.ty].inner {
                TypeInner::Array { size, stride, .. } => match size {
                    naga::ArraySize::Constant(n) => n.get() * stride,
                    ref other => panic!("{}: {other:?}", source.name),
                },
                _ => 4,
            })
            .sum();
        assert!(shared <= 16 * 1024, "{}: {shared} bytes", source.name);
    }
}

/// Offsets of the members of a struct of `layout.wgsl`, and its size.
fn members(module: &Module, name: &str) -> (Vec<(String, u32)>, u32) {
    let found = module
        .types
        .iter()
        .find(|(_, held)| held.name.as_deref() == Some(name));
    let (_, held) = found.unwrap_or_else(|| panic!("no struct {name}"));
    let TypeInner::Struct { members, span } = &held.inner else {
        panic!("{name} is no struct");
    };
    let offsets = members
        .iter()
        .map(|member| (member.name.clone().unwrap_or_default(), member.offset))
        .collect();
    (offsets, *span)
}

/// Asserts that a struct has the same members at the same offsets on both sides.
macro_rules! assert_twins {
    ($module:expr, $($name:ident { $($field:ident),* })*) => {
        $(
            let (shader, span) = members($module, stringify!($name));
            let host = vec![
                $((stringify!($field).to_owned(), std::mem::offset_of!($name, $field) as u32),)*
            ];
            assert_eq!(shader, host, stringify!($name));
            assert_eq!(span as usize, size_of::<$name>(), stringify!($name));
        )*
    };
}

#[test]
fn structs_are_laid_out_as_on_the_host() {
    // Every kernel begins with the whole layout.
    let module = parse(&TRAVERSAL);
    assert_twins!(&module,
        Node { low, first_child, high, shape }
        Body { root, slack, within, part, category, mask, first_slot, first_number }
        Cluster { first_slot, first_vertex, sizes, body }
        Level { first, count }
        NodePair { a, b }
        WorkItem { a, b }
        Candidate { a, b }
        PairKey { low, high }
        UnsureKey { low, high }
        PairTimes { free_until, touches_by }
        Params {
            first, count, counter, per_group, capacity, slot, n_ignored, resolve, group_size,
            lambda, most_cells, owner_rule, lists_only, n_entries, tile_row, tile_column, tile_side,
            by_number, sought, kinds, reach, queue_room, items_room, kept_room, entries_room, pairs_room,
            searched_room
        }
        Kept { low, slot, high, body, range, unused }
        Grid { origin, shift, scale, n_cells, finest, unused, resolution, unused_too }
        Cell { n_entries, highest, lowest }
        CellItem { cell, sizes, first_a, first_b }
        Arguments { x, y, z }
    );
    assert_eq!(size_of::<Step>(), 256);
    // The shader has an unnamed gap after each corner; the host names it.
    let (reach, span) = members(&module, "Reach");
    assert_eq!(reach, [("low".to_owned(), 0), ("high".to_owned(), 16)]);
    assert_eq!(span as usize, size_of::<Reach>());
    assert_eq!(std::mem::offset_of!(Reach, high), 16);
}

/// The value of a constant of a kernel.
fn constant(module: &Module, name: &str) -> f64 {
    let (_, constant) = module
        .constants
        .iter()
        .find(|(_, constant)| constant.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("no constant {name}"));
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(naga::Literal::U32(value)) => f64::from(value),
        naga::Expression::Literal(naga::Literal::F32(value)) => f64::from(value),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn constants_are_those_of_the_host() {
    let module = parse(&NARROW);
    for (name, host) in [
        ("ROUNDS", ROUNDS),
        ("N_ITEMS", N_ITEMS),
        ("N_CANDIDATES", N_CANDIDATES),
        ("N_PAIRS", N_PAIRS),
        ("N_UNSURE", N_UNSURE),
        ("TOO_MUCH", TOO_MUCH),
        ("N_KEPT", N_KEPT),
        ("N_ENTRIES", N_ENTRIES),
        ("N_SUBDIVIDED", N_SUBDIVIDED),
        ("N_BOX_TESTS", N_BOX_TESTS),
        ("N_BOX_TESTS_HIGH", N_BOX_TESTS_HIGH),
        ("TOUCHES_BY", TOUCHES_BY),
        ("N_PAIRS_LISTED", N_PAIRS_LISTED),
        ("N_UNSURE_LISTED", N_UNSURE_LISTED),
        ("N_COUNTERS", N_COUNTERS),
        ("KIND_VERTEX_FACE", KIND_VERTEX_FACE),
        ("KIND_EDGE_EDGE", KIND_EDGE_EDGE),
        ("KIND_EDGE_VERTEX", KIND_EDGE_VERTEX),
        ("KIND_VERTEX_VERTEX", KIND_VERTEX_VERTEX),
        ("SEEK_ALL", SEEK_ALL),
        ("SEEK_EARLIEST", SEEK_EARLIEST),
        ("SEEK_ANY", SEEK_ANY),
        ("N_TALLIES", N_TALLIES),
        ("NO_ROOT", NO_ROOT),
        ("CHILDREN", CHILDREN),
        ("GATE", GATE),
        ("FLAG", FLAG),
        ("EDGES", EDGES),
        ("VERTICES", VERTICES),
        ("FACES", FACES),
        ("BARE", BARE),
        ("POINTS", POINTS),
        ("OWN_PARTS", OWN_PARTS),
        ("BODY_SHIFT", BODY_SHIFT),
        ("RULES_N_GROUPS", RULES_N_GROUPS),
        ("RULES_GROUPS", RULES_GROUPS),
        ("RULES_LISTS", RULES_LISTS),
        ("RULES_PAIRS", RULES_PAIRS),
        ("RULES_N_PAIRS", RULES_N_PAIRS),
        ("RULES_MARKS", RULES_MARKS),
        ("PINNED", PINNED),
    ] {
        assert_eq!(constant(&module, name), f64::from(host), "{name}");
    }
}

#[test]
fn constants_of_single_kernels_are_those_of_the_host() {
    for (source, name, host) in [
        (&PREPARE, "WIDEST", super::recording::WIDEST),
        (&GRID_RESOLUTION, "MOST_ALONG", grid::MOST_ALONG.into()),
        (&GRID_SHIFT, "MOST_ENTRIES_EACH", grid::MOST_ENTRIES_EACH),
    ] {
        // All are below 2^53.
        let host = host as f64;
        assert_eq!(constant(&parse(source), name), host, "{name}");
    }
}

/// Direct3D 12 says 0 in indirect dispatches, and large scenes would lose pairs there.
#[test]
fn no_kernel_asks_for_the_number_of_workgroups() {
    for (source, _) in ALL {
        let module = parse(source);
        let arguments = module.entry_points.iter();
        let arguments = arguments.flat_map(|entry| &entry.function.arguments);
        for argument in arguments {
            let number = naga::Binding::BuiltIn(naga::BuiltIn::NumWorkGroups);
            assert_ne!(argument.binding, Some(number), "{}", source.name);
        }
    }
}

#[test]
fn a_broken_kernel_is_noticed() {
    let broken = Source {
        name: "broken",
        parts: &["fn f() -> u32 { return 1.5; }"],
    };
    assert!(std::panic::catch_unwind(|| parse(&broken)).is_err());
}
