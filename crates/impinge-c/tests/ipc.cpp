// impinge/ipc.hpp beside ipc-toolkit itself: the same candidates, fewer of them where they are exact, and the same steps.
#include "common.h"
#include <impinge/ipc.hpp>

#include <ipc/broad_phase/brute_force.hpp>
#include <ipc/broad_phase/lbvh.hpp>
#include <ipc/candidates/candidates.hpp>
#include <ipc/ccd/tight_inclusion_ccd.hpp>
#include <ipc/ipc.hpp>

#include <limits>
#include <set>
#include <string>
#include <thread>

namespace {

using pairs_of_ids = std::set<std::array<long, 2>>;

template <class List, class Ids> pairs_of_ids ids(const List &list, Ids of, bool is_ordered) {
  pairs_of_ids found;
  for (const auto &each : list) {
    auto [a, b] = of(each);
    CHECK(found.insert(is_ordered ? std::array<long, 2>{a, b} : std::array<long, 2>{std::min(a, b), std::max(a, b)}).second);
  }
  return found;
}

struct all_ids {
  pairs_of_ids ee, fv, ev, vv;
  explicit all_ids(const ::ipc::Candidates &of) {
    ee = ids(of.ee_candidates, [](const auto &c) { return std::array<long, 2>{c.edge0_id, c.edge1_id}; }, false);
    fv = ids(of.fv_candidates, [](const auto &c) { return std::array<long, 2>{c.face_id, c.vertex_id}; }, true);
    ev = ids(of.ev_candidates, [](const auto &c) { return std::array<long, 2>{c.edge_id, c.vertex_id}; }, true);
    vv = ids(of.vv_candidates, [](const auto &c) { return std::array<long, 2>{c.vertex0_id, c.vertex1_id}; }, false);
  }
  std::size_t size() const { return ee.size() + fv.size() + ev.size() + vv.size(); }
  bool holds(const all_ids &other) const {
    const auto in = [](const pairs_of_ids &all, const pairs_of_ids &some) { return std::includes(all.begin(), all.end(), some.begin(), some.end()); };
    return in(ee, other.ee) && in(fv, other.fv) && in(ev, other.ev) && in(vv, other.vv);
  }
};

// Two balls of faces, strands of loose edges, and loose vertices: edges are numbered from the last face to the first.
struct model {
  Eigen::MatrixXd start, end;
  Eigen::MatrixXi edges, faces;
};

model make_model() {
  static ball balls[2];
  make_ball(&balls[0], 0);
  make_ball(&balls[1], 2.05);
  constexpr int n_strands = 40, n_points = 60, first_strand = 2 * VERTICES, first_point = first_strand + 2 * n_strands;
  model of;
  of.start.resize(first_point + n_points, 3);
  of.faces.resize(2 * FACES, 3);
  for (int which = 0; which < 2; ++which) {
    for (int v = 0; v < VERTICES; ++v) of.start.row(which * VERTICES + v) = Eigen::Map<const Eigen::RowVector3d>(balls[which].positions[v]);
    for (int f = 0; f < FACES; ++f)
      for (int k = 0; k < 3; ++k) of.faces(which * FACES + f, k) = static_cast<int>(balls[which].faces[f][k]) + which * VERTICES;
  }
  std::srand(5);
  // Just outside the first ball, and too short to pass through anything.
  of.start.bottomRows(2 * n_strands + n_points).setRandom();
  for (int s = 0; s < n_strands; ++s) {
    const int v = first_strand + 2 * s;
    of.start.row(v + 1) = of.start.row(v).normalized() + 0.03 * of.start.row(v + 1);
  }
  for (Eigen::Index v = first_strand; v < of.start.rows(); ++v) of.start.row(v) = of.start.row(v).normalized() * 1.03;
  std::set<std::array<int, 2>> sides;
  for (Eigen::Index f = 0; f < of.faces.rows(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(of.faces(f, k), of.faces(f, (k + 1) % 3));
      sides.insert({b, a});
    }
  of.edges.resize(static_cast<Eigen::Index>(sides.size()) + n_strands, 2);
  Eigen::Index e = of.edges.rows();
  for (const auto &[a, b] : sides) of.edges.row(--e) << a, b;
  for (int s = 0; s < n_strands; ++s) of.edges.row(--e) << first_strand + 2 * s, first_strand + 2 * s + 1;
  of.end = of.start;
  for (Eigen::Index v = 0; v < of.end.rows(); ++v) of.end(v, 0) -= v < VERTICES ? -0.05 : 0.1;
  return of;
}

void candidates(const ::ipc::CollisionMesh &mesh, const model &of) {
  const auto ask = [&](::ipc::BroadPhase &with, bool moves, double radius) {
    ::ipc::Candidates found;
    if (moves)
      found.build(mesh, of.start, of.end, radius, &with);
    else
      found.build(mesh, of.start, radius, &with);
    return all_ids(found);
  };
  ::ipc::LBVH lbvh;
  impinge::ipc::BroadPhase exact, boxes(impinge::ipc::mode::boxes);
  CHECK(exact.name() != boxes.name());
  for (const bool moves : {false, true}) {
    const auto expected = ask(lbvh, moves, 0.01), in_boxes = ask(boxes, moves, 0.01), near = ask(exact, moves, 0.01);
    std::printf("%s: LBVH %zu, boxes %zu, exact %zu\n", moves ? "moving" : "still", expected.size(), in_boxes.size(), near.size());
    // Theirs may round boxes up by a little.
    CHECK(expected.holds(in_boxes) && in_boxes.size() * 1.01 > expected.size());
    CHECK(in_boxes.holds(near) && !near.ee.empty() && !near.fv.empty() && near.size() < in_boxes.size());
    // Nothing within twice the radius at the start is missing.
    ::ipc::Candidates all;
    all.build(mesh, of.start, 0.01, &lbvh);
    for (const auto &c : all.ee_candidates)
      if (c.compute_distance(of.start, mesh.edges(), mesh.faces()) < 0.02 * 0.02 * (1 - 1e-12))
        CHECK(near.ee.count({std::min(c.edge0_id, c.edge1_id), std::max(c.edge0_id, c.edge1_id)}) == 1);
    for (const auto &c : all.fv_candidates)
      if (c.compute_distance(of.start, mesh.edges(), mesh.faces()) < 0.02 * 0.02 * (1 - 1e-12)) CHECK(near.fv.count({c.face_id, c.vertex_id}) == 1);
  }
}

void steps(const ::ipc::CollisionMesh &mesh, const model &of) {
  impinge::ipc::BroadPhase exact;
  const impinge::ipc::NarrowPhaseCCD ccd;
  const auto step = [&](::ipc::BroadPhase *with, const ::ipc::NarrowPhaseCCD &narrow) {
    ::ipc::Candidates found;
    found.build(mesh, of.start, of.end, 0, with);
    return found.compute_collision_free_stepsize(mesh, of.start, of.end, 0, narrow);
  };
  ::ipc::LBVH lbvh;
  // Tight Inclusion compares axis by axis, and still stops for no pair that exact mode leaves out.
  CHECK(step(&exact, ::ipc::TightInclusionCCD()) == step(&lbvh, ::ipc::TightInclusionCCD()));
  const double theirs = step(&lbvh, ::ipc::TightInclusionCCD()), with_pairs = step(&lbvh, ccd), in_exact = step(&exact, ccd);
  const double whole = impinge::ipc::compute_collision_free_stepsize(mesh, of.start, of.end);
  std::printf("steps: Tight Inclusion %.9g, exact per pair %.9g and %.9g, whole %.9g\n", theirs, with_pairs, in_exact, whole);
  CHECK(with_pairs == in_exact && whole > 0 && whole < 1);
  // Rounded down to 24 bits, and for rounded positions.
  CHECK(whole <= with_pairs && whole > with_pairs - 1e-6 && theirs <= with_pairs * (1 + 1e-9) && theirs > 0.5 * with_pairs);
  const Eigen::MatrixXd reached = of.start + whole * (of.end - of.start);
  CHECK(impinge::ipc::is_step_collision_free(mesh, of.start, reached) && !impinge::ipc::is_step_collision_free(mesh, of.start, of.end));
  CHECK(!impinge::ipc::has_intersections(mesh, reached) && impinge::ipc::has_intersections(mesh, of.end));
}

// A vertex that ends 5e-5 above a face: near enough for a narrow phase to stop it, but no boxes overlap, so none is asked.
void gap() {
  Eigen::MatrixXd start(4, 3), end;
  start << -1, -1, 0, 1, -1, 0, 0, 1, 0, 0, 0, 0.01;
  Eigen::MatrixXi edges(3, 2), faces(1, 3);
  edges << 0, 1, 1, 2, 0, 2;
  faces << 0, 1, 2;
  const ::ipc::CollisionMesh mesh(start, edges, faces);
  for (const double distance : {0.0, 1e-3}) {
    end = start;
    end(3, 2) = distance + 5e-5;
    ::ipc::LBVH lbvh;
    impinge::ipc::BroadPhase exact;
    CHECK(::ipc::compute_collision_free_stepsize(mesh, start, end, distance, &lbvh) == 1);
    CHECK(::ipc::compute_collision_free_stepsize(mesh, start, end, distance, &exact) == 1);
    CHECK(::ipc::compute_collision_free_stepsize(mesh, start, end, distance, &exact, impinge::ipc::NarrowPhaseCCD()) == 1);
    // The whole step keeps 1e-4 of every pair.
    CHECK(impinge::ipc::compute_collision_free_stepsize(mesh, start, end, distance) < 1);
    end(3, 2) = distance - 5e-5;
    const double theirs = ::ipc::compute_collision_free_stepsize(mesh, start, end, distance, &lbvh);
    CHECK(theirs < 1 && ::ipc::compute_collision_free_stepsize(mesh, start, end, distance, &exact) == theirs);
  }
}

template <class Call> bool refuses(Call call) {
  try {
    call();
  } catch (const impinge::error &) {
    return true;
  }
  return false;
}

// What a call is refused with; nothing if it is not.
template <class Call> std::string said_by(Call call) {
  try {
    call();
  } catch (const impinge::error &error) {
    return error.what();
  }
  return {};
}

template <class Candidate, class Detect> std::size_t count(Detect detect) {
  std::vector<Candidate> found;
  detect(found);
  return found.size();
}
std::size_t n_ee(const ::ipc::BroadPhase &of) {
  return count<::ipc::EdgeEdgeCandidate>([&](auto &found) { of.detect_edge_edge_candidates(found); });
}
std::size_t n_fv(const ::ipc::BroadPhase &of) {
  return count<::ipc::FaceVertexCandidate>([&](auto &found) { of.detect_face_vertex_candidates(found); });
}
std::size_t n_ev(const ::ipc::BroadPhase &of) {
  return count<::ipc::EdgeVertexCandidate>([&](auto &found) { of.detect_edge_vertex_candidates(found); });
}

std::vector<std::array<long, 2>> pairs_of_edges(const ::ipc::BroadPhase &of) {
  std::vector<::ipc::EdgeEdgeCandidate> found;
  of.detect_edge_edge_candidates(found);
  std::vector<std::array<long, 2>> rows;
  for (const auto &c : found) rows.push_back({c.edge0_id, c.edge1_id});
  std::sort(rows.begin(), rows.end());
  return rows;
}
std::size_t n_vv(const ::ipc::BroadPhase &of) {
  return count<::ipc::VertexVertexCandidate>([&](auto &found) { of.detect_vertex_vertex_candidates(found); });
}
std::size_t n_ef(const ::ipc::BroadPhase &of) {
  return count<::ipc::EdgeFaceCandidate>([&](auto &found) { of.detect_edge_face_candidates(found); });
}

// A loose edge between two faces, whose sides are no edges of the caller's, or are.
void loose_edges(impinge::ipc::mode mode) {
  Eigen::MatrixXd at(8, 3);
  at << 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.05, 1, 0, 0.05, 0, 1, 0.05, -1, 0.2, 0.02, 2, 0.2, 0.02;
  Eigen::MatrixXi faces(2, 3), alone(1, 2), all(7, 2);
  faces << 0, 1, 2, 3, 4, 5;
  alone << 6, 7;
  all << 6, 7, 0, 1, 1, 2, 2, 0, 3, 4, 4, 5, 5, 3;
  impinge::ipc::BroadPhase ours(mode);
  ::ipc::BruteForce theirs;
  for (const Eigen::MatrixXi &edges : {alone, all})
    for (const bool moves : {false, true}) {
      for (::ipc::BroadPhase *with : {static_cast<::ipc::BroadPhase *>(&ours), static_cast<::ipc::BroadPhase *>(&theirs)})
        moves ? with->build(at, at, edges, faces, 0.3) : with->build(at, edges, faces, 0.3);
      // The lower edge comes first, whichever of them is a side.
      CHECK(pairs_of_edges(ours) == pairs_of_edges(theirs) && n_ef(ours) == n_ef(theirs) && n_ef(ours) > 0);
    }
}

// Two edges that approach: of steps, too, all kinds of pairs are found.
void vertices_of_edges(impinge::ipc::mode mode) {
  Eigen::MatrixXd start(4, 3);
  start << 0, 0, 0, 1, 0, 0, 0, 0, 0.3, 1, 0, 0.3;
  Eigen::MatrixXd end = start;
  end(2, 2) = end(3, 2) = 0.1;
  Eigen::MatrixXi edges(2, 2);
  edges << 0, 1, 2, 3;
  impinge::ipc::BroadPhase ours(mode);
  ours.build(start, end, edges, Eigen::MatrixXi(), 0.1);
  CHECK(n_vv(ours) == 2 && n_ev(ours) == 4 && n_ee(ours) == 1);
}

// Refusals name the argument, the caller's vertices, and both numbers.
void refusals() {
  Eigen::MatrixXd at(6, 3);
  at << 0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5, 7, 7, 7, 5, 5, 5;
  Eigen::MatrixXi edges(3, 2), faces(1, 3);
  edges << 0, 1, 1, 2, 2, 0;
  faces << 0, 1, 2;
  ::ipc::CollisionMesh mesh(at, edges, faces);
  // Two loose vertices at one position, with those of a face before them.
  const std::string seam = said_by([&] { impinge::ipc::compute_collision_free_stepsize(mesh, at, at); });
  CHECK(seam.rfind("vertices 3 and 5 are at one position but not shared", 0) == 0 && seam.find("(1 of its vertices") != seam.npos);
  // The filter leaves them out.
  mesh.can_collide = [](std::size_t a, std::size_t b) { return a != 5 && b != 5; };
  CHECK(impinge::ipc::compute_collision_free_stepsize(mesh, at, at) == 1);
  mesh.can_collide = ::ipc::CollisionMesh(at, edges, faces).can_collide;

  for (const double rescaling : {1.5, 0.0, -1.0, std::nan("")}) {
    std::ostringstream expected;
    expected << "conservative_rescaling: " << rescaling << " given, above 0 and at most 1 allowed";
    CHECK(said_by([&] { impinge::ipc::compute_collision_free_stepsize(mesh, at, at, 0, rescaling); }) == expected.str());
    impinge::ipc::NarrowPhaseCCD ccd;
    ccd.conservative_rescaling = rescaling;
    double toi = 1;
    const Eigen::Vector3d a(0, 0, 0), b(1, 0, 0);
    CHECK(said_by([&] { ccd.point_point_ccd(a, b, b, b, toi); }) == expected.str());
  }

  Eigen::MatrixXd bad = at;
  bad(4, 1) = std::numeric_limits<double>::quiet_NaN();
  const Eigen::MatrixXd few = at.topRows(4), flat = at.leftCols(2);
  CHECK(said_by([&] { impinge::ipc::has_intersections(mesh, bad); }) == "vertices[4, 1] = nan: a position must be finite");
  CHECK(said_by([&] { impinge::ipc::is_step_collision_free(mesh, at, bad); }) == "vertices_t1[4, 1] = nan: a position must be finite");
  CHECK(said_by([&] { impinge::ipc::has_intersections(mesh, few); }) == "vertices: shape (6, 3) expected, as the mesh has, (4, 3) given");
  CHECK(said_by([&] { impinge::ipc::is_step_collision_free(mesh, few, at); }) == "vertices_t0: shape (6, 3) expected, as the mesh has, (4, 3) given");
  CHECK(said_by([&] { impinge::ipc::is_step_collision_free(mesh, at, few); }) == "vertices_t1: shape (6, 3) expected, as the mesh has, (4, 3) given");
  ::ipc::CollisionMesh of_plane(flat, edges, Eigen::MatrixXi());
  CHECK(said_by([&] { impinge::ipc::has_intersections(of_plane, flat); }) == "mesh: two dimensions are not served");

  impinge::ipc::BroadPhase ours;
  CHECK(said_by([&] { ours.build(at, few, edges, faces); }) == "vertices_t1: shape (6, 3) expected, as the mesh has, (4, 3) given");
  CHECK(said_by([&] { ours.build(at, edges, faces, -0.01); }) == "inflation_radius: -0.01 given, a finite number of 0 or more allowed");
  CHECK(said_by([&] { ours.build(at, at, edges, faces, std::nan("")); }) == "inflation_radius: nan given, a finite number of 0 or more allowed");
  const Eigen::MatrixXi some = edges.topRows(1);
  CHECK(said_by([&] { ours.build(at, some, faces); }) == "edges: a face has the edge (0, 2), which is not among them: list all edges of faces, or none");
  Eigen::MatrixXi twice(4, 2);
  twice << edges, 1, 0;
  CHECK(said_by([&] { ours.build(at, twice, faces); }) == "edges[0] and edges[3]: both are the edge (0, 1)");
}

// Elements that touch allow no step, which takes a second question to say. One that was cancelled says that, and no step size.
void cancelled() {
  Eigen::MatrixXd start(4, 3), end;
  start << -1, -1, 0, 1, -1, 0, 0, 1, 0, 0, 0, 0.5;
  Eigen::MatrixXi edges(3, 2), faces(1, 3);
  edges << 0, 1, 1, 2, 0, 2;
  faces << 0, 1, 2;
  const ::ipc::CollisionMesh mesh(start, edges, faces);
  start(3, 2) = 0;
  end = start;
  end(3, 2) = -1;
  CHECK(impinge::ipc::compute_collision_free_stepsize(mesh, start, end) == 0);
  int n_asked = 0;
  auto &asked = impinge::ipc::detail::of_mesh(mesh).detector();
  asked = impinge::detector(impinge::settings(impinge::backend::cpu).cancelled([&] { return n_asked++ == 0; }));
  impinge_status status = IMPINGE_OK;
  try {
    impinge::ipc::compute_collision_free_stepsize(mesh, start, end);
  } catch (const impinge::error &error) {
    status = error.status();
  }
  CHECK(status == IMPINGE_ERROR_CANCELLED && n_asked > 0);
  asked = impinge::detector(impinge::backend::cpu);
}

// What ipc-toolkit's functions do not ask in this way, but a solver may ask a broad phase.
void asked_alone(impinge::ipc::mode mode, const model &of) {
  impinge::ipc::BroadPhase ours(mode);
  ::ipc::LBVH lbvh;
  const Eigen::MatrixXi none;
  // Faces without edges have no pairs of edges.
  ours.build(of.start, none, of.faces, 0.05);
  lbvh.build(of.start, none, of.faces, 0.05);
  CHECK(n_ee(ours) == 0 && n_ee(lbvh) == 0 && n_ev(ours) == 0 && n_fv(ours) > 0);

  // Before a build, after clear and after positions that are refused, there is nothing to ask for.
  const std::string nothing = "BroadPhase: nothing is built: build it first, also after clear() and after a build that failed";
  const impinge::ipc::BroadPhase fresh(mode);
  CHECK(said_by([&] { n_ee(fresh); }) == nothing && said_by([&] { n_fv(fresh); }) == nothing);
  ours.clear();
  CHECK(said_by([&] { n_ef(ours); }) == nothing && said_by([&] { n_vv(ours); }) == nothing);
  Eigen::MatrixXd bad = of.start;
  bad(5, 1) = std::numeric_limits<double>::quiet_NaN();
  ours.build(of.start, of.edges, of.faces, 0.05);
  CHECK(n_ee(ours) > 0);
  CHECK(refuses([&] { ours.build(bad, of.edges, of.faces, 0.05); }) && said_by([&] { n_ee(ours); }) == nothing);
  CHECK(refuses([&] { ours.build(of.start, bad, of.edges, of.faces, 0.05); }) && said_by([&] { n_ev(ours); }) == nothing);

  // Elements whose vertices are not there.
  for (const int vertex : {-1, static_cast<int>(of.start.rows()), 1 << 30}) {
    Eigen::MatrixXi edges = of.edges, faces = of.faces;
    edges(3, 1) = faces(3, 1) = vertex;
    CHECK(refuses([&] { ours.build(of.start, edges, of.faces); }) && refuses([&] { ours.build(of.start, of.edges, faces); }));
  }
  CHECK(refuses([&] { ours.build(of.start, none, Eigen::MatrixXi::Zero(1, 2)); }));

  // Several threads ask at once.
  ours.build(of.start, of.edges, of.faces, 0.05);
  const std::size_t ee = n_ee(ours), fv = n_fv(ours);
  std::atomic<int> n_same{0};
  for (int turn = 0; turn < 20; ++turn) {
    ours.build(of.start, of.edges, of.faces, 0.05);
    std::thread first([&] { n_same += !refuses([&] { CHECK(n_ee(ours) == ee); }); });
    std::thread second([&] { n_same += !refuses([&] { CHECK(n_fv(ours) == fv); }); });
    first.join();
    second.join();
  }
  CHECK(n_same == 40);

  // In two dimensions, too, it is asked with the filter that it has then.
  const Eigen::MatrixXd flat = of.start.leftCols(2);
  ours.build(flat, of.edges, none, 0.05);
  lbvh.build(flat, of.edges, none, 0.05);
  CHECK(n_ev(ours) > 0 && n_ev(ours) == n_ev(lbvh));
  ours.can_vertices_collide = [](std::size_t, std::size_t) { return false; };
  CHECK(n_ev(ours) == 0);
}

} // namespace

int main() {
  const model of = make_model();
  ::ipc::CollisionMesh mesh(of.start, of.edges, of.faces);
  CHECK(mesh.num_codim_edges() == 40 && mesh.num_codim_vertices() == 60);
  candidates(mesh, of);
  steps(mesh, of);
  gap();
  // A filter: the second ball collides with nothing.
  mesh.can_collide = [](std::size_t a, std::size_t b) { return (a < VERTICES || a >= 2 * VERTICES) && (b < VERTICES || b >= 2 * VERTICES); };
  candidates(mesh, of);
  // Only the first ball with itself, which does not change.
  mesh.can_collide = [](std::size_t a, std::size_t b) { return a < VERTICES && b < VERTICES; };
  CHECK(impinge::ipc::compute_collision_free_stepsize(mesh, of.start, of.end) == 1 && impinge::ipc::is_step_collision_free(mesh, of.start, of.end));
  mesh.can_collide = [](std::size_t, std::size_t) -> bool { throw std::runtime_error("from a filter"); };
  try {
    impinge::ipc::compute_collision_free_stepsize(mesh, of.start, of.end);
    CHECK(!"it has thrown");
  } catch (const std::runtime_error &error) {
    CHECK(strcmp(error.what(), "from a filter") == 0);
  }
  for (const auto mode : {impinge::ipc::mode::boxes, impinge::ipc::mode::exact}) {
    asked_alone(mode, of);
    loose_edges(mode);
    vertices_of_edges(mode);
  }
  refusals();
  cancelled();
  return finish("ipc");
}
