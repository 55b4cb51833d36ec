/// impinge/ipc.hpp: impinge in the place of ipc-toolkit's collision stage, for programs that have ipc-toolkit 1.6 and its Eigen (5.0.1 and 3.4 were tried).
///
///     impinge::ipc::BroadPhase broad_phase;
///     collisions.build(mesh, vertices, dhat, 0, &broad_phase);                                      // and everything else that takes one
///     step = impinge::ipc::compute_collision_free_stepsize(mesh, vertices_t0, vertices_t1, dmin);   // the whole step at once
///
/// docs/from-ipc-toolkit.md says what differs, and how to build. Everything here throws `impinge::error`. All edges of faces are among the edges,
/// each once: an edge that is there twice, which `CollisionMesh` takes, is refused. A `BroadPhase` also takes faces without any of their edges.
#ifndef IMPINGE_IPC_HPP
#define IMPINGE_IPC_HPP

#include <impinge/eigen.hpp>

#include <ipc/broad_phase/broad_phase.hpp>
#include <ipc/broad_phase/default_broad_phase.hpp>
#include <ipc/ccd/narrow_phase_ccd.hpp>
#include <ipc/collision_mesh.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <list>
#include <map>
#include <mutex>
#include <sstream>

namespace impinge {
inline namespace IMPINGE_MODE {
namespace ipc {

/// What a `BroadPhase` finds. `boxes`: pairs whose inflated boxes overlap, as ipc-toolkit's own do. `exact`: of these only pairs that come
/// within twice the inflation radius; in a step all that Tight Inclusion may stop for, which compares axis by axis: pairs that come within
/// the square root of 3 times the sum of twice the radius and 1.1e-4. So step sizes of either narrow phase are those that `boxes` gives, but where
/// Tight Inclusion ends its search of a pair early: where it does depends on the pairs asked before.
enum class mode { boxes, exact };

/// `conservative_rescaling` of ipc-toolkit's continuous detection.
constexpr double default_rescaling = 0.8;
/// The largest distance that a step leaves, as in ipc-toolkit.
constexpr double default_clearance = 1e-4;

/// Tight Inclusion keeps up to this beyond the distance that is asked for, give or take its tolerance.
constexpr double kept_in_steps = 1.1e-4;
/// It compares axis by axis, so it stops for pairs that are farther apart by the square root of 3, rounded up.
constexpr double by_axes = 1.7320508075688774;
/// By how much more than twice the radius pairs are looked for: whoever tests them rounds.
constexpr double slack = 1 + 1e-9;

namespace detail {

using ids = std::vector<std::uint32_t>;

/// Throws a message that is made of texts and numbers.
template <class... Part> [[noreturn]] void refuse(const Part &...parts) {
  std::ostringstream message;
  (message << ... << parts);
  impinge::detail::refuse(message.str().c_str());
}

/// The share of its distance that a pair keeps.
inline double share_kept(double conservative_rescaling) {
  if (!(conservative_rescaling > 0 && conservative_rescaling <= 1))
    refuse("conservative_rescaling: ", conservative_rescaling, " given, above 0 and at most 1 allowed");
  return 1 - conservative_rescaling;
}

/// Refuses positions that are not those of `n` vertices, or not finite.
inline void check_positions(const char *name, Eigen::Ref<const Eigen::MatrixXd> at, Eigen::Index n) {
  if (at.rows() != n || at.cols() != 3) refuse(name, ": shape (", n, ", 3) expected, as the mesh has, (", at.rows(), ", ", at.cols(), ") given");
  if (at.allFinite()) return;
  for (Eigen::Index v = 0; v < n; ++v)
    for (Eigen::Index k = 0; k < 3; ++k)
      if (!std::isfinite(at(v, k))) refuse(name, "[", v, ", ", k, "] = ", at(v, k), ": a position must be finite");
}

/// Vertices, edges and faces of ipc-toolkit as up to three bodies of a scene: faces, with the edges of the caller; edges of no face; vertices of
/// neither. The edges of a body are those of the caller that it has, in the caller's order.
class bodies {
public:
  bodies(Eigen::Index n, const Eigen::MatrixXi &edges, const Eigen::MatrixXi &faces, settings of)
      : n_(n), edges_(edges), faces_(faces), on_faces_(static_cast<std::size_t>(n)), settings_(of), detector_(std::move(of)) {
    const auto are_there = [n](const Eigen::MatrixXi &of, Eigen::Index corners) {
      return of.rows() == 0 || (of.cols() == corners && of.minCoeff() >= 0 && of.maxCoeff() < n);
    };
    if (!are_there(edges, 2) || !are_there(faces, 3)) refuse("edges or faces: not 2 or 3 vertices in a row, or a vertex that is not there");
    std::vector<char> is_used(static_cast<std::size_t>(n));
    std::vector<std::array<int, 2>> sides;
    for (Eigen::Index f = 0; f < faces.rows(); ++f)
      for (int k = 0; k < 3; ++k) {
        on_faces_[static_cast<std::size_t>(faces(f, k))] = is_used[static_cast<std::size_t>(faces(f, k))] = 1;
        const auto [a, b] = std::minmax(faces(f, k), faces(f, (k + 1) % 3));
        sides.push_back({a, b});
      }
    std::sort(sides.begin(), sides.end());
    sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
    std::vector<Eigen::Index> row_of(sides.size(), -1);
    for (Eigen::Index e = 0; e < edges.rows(); ++e) {
      const auto [a, b] = std::minmax(edges(e, 0), edges(e, 1));
      const std::array<int, 2> ends{a, b};
      const auto at = std::lower_bound(sides.begin(), sides.end(), ends);
      const bool is_side = at != sides.end() && *at == ends;
      (is_side ? sides_ : loose_edges_).push_back(static_cast<std::uint32_t>(e));
      if (is_side) {
        auto &row = row_of[static_cast<std::size_t>(at - sides.begin())];
        if (row >= 0) refuse("edges[", row, "] and edges[", e, "]: both are the edge (", a, ", ", b, ")");
        row = e;
        continue;
      }
      is_used[static_cast<std::size_t>(a)] = is_used[static_cast<std::size_t>(b)] = 1;
    }
    for (std::size_t ix = 0; !sides_.empty() && ix < sides.size(); ++ix) {
      const auto [a, b] = sides[ix];
      if (row_of[ix] < 0 && a != b) refuse("edges: a face has the edge (", a, ", ", b, "), which is not among them: list all edges of faces, or none");
    }
    for (std::size_t v = 0; v < is_used.size(); ++v)
      if (!is_used[v]) points_.push_back(static_cast<std::uint32_t>(v));
  }

  bool are_of(Eigen::Index n, const Eigen::MatrixXi &edges, const Eigen::MatrixXi &faces) const {
    const auto same = [](const Eigen::MatrixXi &a, const Eigen::MatrixXi &b) { return a.rows() == b.rows() && (a.rows() == 0 || a == b); };
    return n == n_ && same(edges, edges_) && same(faces, faces_);
  }

  /// All vertices stand still.
  void place(Eigen::Ref<const Eigen::MatrixXd> at, const char *name = "vertices") {
    check_positions(name, at, n_);
    if (scene_.n_bodies() == 0) return add(at);
    for_parts(at, [&](body of, const auto &part) { scene_.set_positions(of, part); });
  }
  /// They move.
  void place(Eigen::Ref<const Eigen::MatrixXd> start, Eigen::Ref<const Eigen::MatrixXd> end, const char *name_t0 = "vertices_t0",
             const char *name_t1 = "vertices_t1") {
    place(start, name_t0);
    check_positions(name_t1, end, n_);
    for_parts(end, [&](body of, const auto &part) { scene_.set_end_positions(of, part); });
  }

  /// The caller's numbers of an element: of `part` 0 for vertices, 1 for edges, 2 for faces.
  std::uint32_t number(int part, body of, std::uint32_t element) const {
    if (part == 0 && of == of_points_) return points_[element];
    if (part == 1 && of == of_loose_edges_) return loose_edges_[element];
    if (part == 1) return sides_[element];
    return element;
  }
  /// Whether the caller has an element by this body: an edge of a face may be none of the caller's, and a vertex of a face and of a loose edge
  /// meets all that it meets as one of the face.
  bool is_asked(int part, body of, std::uint32_t element) const {
    return part == 0 ? of != of_loose_edges_ || on_faces_[element] == 0 : part != 1 || of != of_faces_ || !sides_.empty();
  }
  /// The vertices of an element by the caller's number.
  view<int> corners(int part, std::uint32_t number, std::array<int, 3> &room) const {
    if (part == 0) room[0] = static_cast<int>(number);
    const Eigen::MatrixXi &of = part == 2 ? faces_ : edges_;
    for (int k = 0; part > 0 && k <= part; ++k) room[static_cast<std::size_t>(k)] = of(static_cast<Eigen::Index>(number), k);
    return {room.data(), static_cast<std::size_t>(part) + 1};
  }
  view<int> corners(int part, body of, std::uint32_t element, std::array<int, 3> &room) const { return corners(part, number(part, of, element), room); }
  /// The caller's number of a vertex of an element that a filter is asked about.
  int vertex(const impinge_element &of, std::uint32_t k) const {
    return static_cast<int>(of.body == of_points_ ? points_[of.vertices[k]] : of.vertices[k]);
  }

  /// What a body was given as: 0 for vertices, 1 for edges, 2 for faces.
  int given(body of) const { return of == of_faces_ ? 2 : of == of_loose_edges_ ? 1 : 0; }

  const impinge::scene &scene() const { return scene_; }
  impinge::detector &detector() { return detector_; }
  /// The pairs within a distance. A solver asks again and again while little moves.
  near_pairs near(double distance, const query &of) {
    const double margin = settings_.reuse_margin();
    // A margin fits other distances of about the same size. Another one takes a new detector; one of the caller's stays.
    if (distance > 0 && std::isfinite(distance) && (is_margin_ours_ || margin == 0) && !(distance / 16 <= margin && margin <= distance / 2)) {
      is_margin_ours_ = true;
      detector_ = impinge::detector(settings_.reuse_margin(distance / 4));
    }
    return detector_.near(scene_, distance, of);
  }
  bool has_faces() const { return faces_.rows() > 0; }
  /// Held while a thread asks the detector, and not while a filter is called.
  std::mutex asked;

private:
  template <class Set> void for_parts(Eigen::Ref<const Eigen::MatrixXd> at, Set set) {
    if (of_faces_ != IMPINGE_ANY_BODY) set(of_faces_, at);
    if (of_loose_edges_ != IMPINGE_ANY_BODY) set(of_loose_edges_, at);
    if (of_points_ != IMPINGE_ANY_BODY) set(of_points_, points(at));
  }
  Eigen::MatrixXd points(Eigen::Ref<const Eigen::MatrixXd> at) const {
    Eigen::MatrixXd rows(static_cast<Eigen::Index>(points_.size()), 3);
    for (std::size_t ix = 0; ix < points_.size(); ++ix) rows.row(static_cast<Eigen::Index>(ix)) = at.row(static_cast<Eigen::Index>(points_[ix]));
    return rows;
  }
  Eigen::MatrixXi edges(const ids &of) const {
    Eigen::MatrixXi rows(static_cast<Eigen::Index>(of.size()), 2);
    for (std::size_t ix = 0; ix < of.size(); ++ix) rows.row(static_cast<Eigen::Index>(ix)) = edges_.row(static_cast<Eigen::Index>(of[ix]));
    return rows;
  }
  void add(Eigen::Ref<const Eigen::MatrixXd> at) {
    impinge::scene made;
    if (has_faces()) {
      of_faces_ = made.add_triangles(faces_, at);
      if (!sides_.empty()) made.set_edges(of_faces_, edges(sides_));
    }
    if (!loose_edges_.empty()) of_loose_edges_ = made.add_edges(edges(loose_edges_), at);
    if (!points_.empty()) of_points_ = made.add_points(points(at));
    scene_ = std::move(made);
  }

  Eigen::Index n_;
  Eigen::MatrixXi edges_, faces_;
  std::vector<char> on_faces_;
  ids sides_, loose_edges_, points_;
  body of_faces_ = IMPINGE_ANY_BODY, of_loose_edges_ = IMPINGE_ANY_BODY, of_points_ = IMPINGE_ANY_BODY;
  impinge::scene scene_;
  settings settings_;
  bool is_margin_ours_ = false;
  impinge::detector detector_;
};

/// The bodies of the meshes that were asked about last.
class known_bodies {
public:
  explicit known_bodies(settings of = backend::cpu) : settings_(std::move(of)) {}
  bodies &of(Eigen::Index n, const Eigen::MatrixXi &edges, const Eigen::MatrixXi &faces) {
    for (auto at = known_.begin(); at != known_.end(); ++at)
      if (at->are_of(n, edges, faces)) {
        known_.splice(known_.begin(), known_, at);
        return known_.front();
      }
    // A mesh with its codimensional vertices and edges is three.
    if (known_.size() >= 4) known_.pop_back();
    known_.emplace_front(n, edges, faces, settings_);
    return known_.front();
  }

private:
  settings settings_;
  std::list<bodies> known_;
};

/// Whether any vertex of one element may collide with any of another.
template <class Filter> bool may_collide(view<int> a, view<int> b, const Filter &filter) {
  for (const int x : a)
    for (const int y : b)
      if (filter(static_cast<std::size_t>(x), static_cast<std::size_t>(y))) return true;
  return false;
}

inline bool share_vertex(view<int> a, view<int> b) {
  return std::any_of(a.begin(), a.end(), [&](int x) { return std::find(b.begin(), b.end(), x) != b.end(); });
}

/// The filter of a mesh, for questions about whole steps. It is called by several threads.
class step_filter {
public:
  step_filter(const bodies &of, const ::ipc::CollisionFilter &filter) : bodies_(of), filter_(filter) {}
  static int passes(void *user, const impinge_element *a, const impinge_element *b) {
    auto &of = *static_cast<step_filter *>(user);
    try {
      return of.pass(*a, *b);
    } catch (...) {
      if (!of.is_thrown_.exchange(true)) of.thrown_ = std::current_exception();
      return 0;
    }
  }
  void rethrow() const {
    if (thrown_) std::rethrow_exception(thrown_);
  }

private:
  bool pass(const impinge_element &a, const impinge_element &b) const {
    std::array<int, 4> of_a{}, of_b{};
    for (std::uint32_t k = 0; k < a.n_vertices; ++k) of_a[k] = bodies_.vertex(a, k);
    for (std::uint32_t k = 0; k < b.n_vertices; ++k) of_b[k] = bodies_.vertex(b, k);
    const view<int> first(of_a.data(), a.n_vertices), second(of_b.data(), b.n_vertices);
    // Within a body the detector sees to neighbours.
    if (a.body != b.body && share_vertex(first, second)) return false;
    return may_collide(first, second, filter_);
  }
  const bodies &bodies_;
  const ::ipc::CollisionFilter &filter_;
  std::atomic<bool> is_thrown_{false};
  std::exception_ptr thrown_;
};

/// The bodies of this thread's meshes, for the functions below.
inline bodies &of_mesh(const ::ipc::CollisionMesh &mesh) {
  if (mesh.dim() != 3) refuse("mesh: two dimensions are not served");
  if (!mesh.planes.empty()) refuse("mesh: planes are not served; give the mesh faces in their place");
  static thread_local known_bodies known;
  return known.of(static_cast<Eigen::Index>(mesh.num_vertices()), mesh.edges(), mesh.faces());
}

/// Refuses, by the mesh's numbers, the lowest two vertices at one position of pairs that touch.
inline void refuse_seams(bodies &of, Eigen::Ref<const Eigen::MatrixXd> start, const query &step) {
  const auto found = of.detector().impacts(of.scene(), step);
  std::optional<std::array<int, 2>> first;
  std::array<int, 3> room_a{}, room_b{};
  struct parts {
    pair_kind kind;
    int a, b;
  };
  for (const auto &[kind, part_a, part_b] : std::array<parts, 4>{{{pair_kind::vf, 0, 2}, {pair_kind::ee, 1, 1}, {pair_kind::ev, 1, 0}, {pair_kind::vv, 0, 0}}})
    for (const auto &row : found.of(kind)) {
      if (!of.is_asked(part_a, row.body_a, row.element_a) || !of.is_asked(part_b, row.body_b, row.element_b)) continue;
      for (const int a : of.corners(part_a, row.body_a, row.element_a, room_a))
        for (const int b : of.corners(part_b, row.body_b, row.element_b, room_b)) {
          const std::array<int, 2> both{std::min(a, b), std::max(a, b)};
          if (a != b && start.row(a) == start.row(b) && (!first || both < *first)) first = both;
        }
    }
  if (!first) return;
  const auto n_coincident = static_cast<std::size_t>(start.rows()) - weld(start).firsts.size();
  refuse("vertices ", (*first)[0], " and ", (*first)[1],
         " are at one position but not shared, so what they belong to touches at the start, and no step can be taken: weld the mesh (", n_coincident,
         " of its vertices lie at positions of others)");
}

} // namespace detail

/// Whether elements of a mesh intersect: faces with faces, loose edges and vertices with all. Exact, and touching counts. Faces that share a
/// vertex count where they meet in more than that: ipc-toolkit does not look at these. A loose edge and what has one of its vertices do not count.
inline bool has_intersections(const ::ipc::CollisionMesh &mesh, Eigen::Ref<const Eigen::MatrixXd> vertices) {
  auto &of = detail::of_mesh(mesh);
  of.place(vertices);
  const auto pairs = of.detector().detect(of.scene());
  std::array<int, 3> room_a{}, room_b{};
  return std::any_of(pairs.begin(), pairs.end(), [&](const pair &row) {
    const int part_a = of.given(row.body_a), part_b = of.given(row.body_b);
    const auto a = of.corners(part_a, of.number(part_a, row.body_a, row.element_a), room_a);
    const auto b = of.corners(part_b, of.number(part_b, row.body_b, row.element_b), room_b);
    return (row.body_a == row.body_b || !detail::share_vertex(a, b)) && detail::may_collide(a, b, mesh.can_collide);
  });
}

/// Whether nothing intersects at the start, and nothing comes nearer than `min_distance` on straight lines to the end. Exact. ipc-toolkit
/// takes it that the start is free.
inline bool is_step_collision_free(const ::ipc::CollisionMesh &mesh, Eigen::Ref<const Eigen::MatrixXd> vertices_t0, Eigen::Ref<const Eigen::MatrixXd> vertices_t1,
                                   double min_distance = 0) {
  auto &of = detail::of_mesh(mesh);
  of.place(vertices_t0, vertices_t1);
  detail::step_filter filter(of, mesh.can_collide);
  const bool is_free =
      of.detector().is_free(of.scene(), query::all().separation(min_distance).start(start::verify).passes(detail::step_filter::passes, &filter));
  filter.rethrow();
  return is_free;
}

/// How far all vertices can move on straight lines from one pose towards another: the largest step in [0, 1] for which every pair keeps
/// min_distance + min((1 - conservative_rescaling) * (d - min_distance), 1e-4), where d is its distance at the start: vertices and faces, edges and
/// edges, and, which ipc-toolkit does not ask, a loose edge and a vertex of another one. This holds for positions that
/// the caller computes, rounding included, and for every smaller step. 0 if elements touch at the start.
///
/// As in ipc-toolkit, the start must be free of intersections, and is not asked. Throws for a mesh whose vertices at one position are not
/// shared where they touch: every step would be 0.
inline double compute_collision_free_stepsize(const ::ipc::CollisionMesh &mesh, Eigen::Ref<const Eigen::MatrixXd> vertices_t0,
                                              Eigen::Ref<const Eigen::MatrixXd> vertices_t1, double min_distance = 0,
                                              double conservative_rescaling = default_rescaling) {
  auto &of = detail::of_mesh(mesh);
  of.place(vertices_t0, vertices_t1);
  detail::step_filter filter(of, mesh.can_collide);
  // With all of its distance to lose, a pair still keeps what rounding moves.
  const double share = std::max(detail::share_kept(conservative_rescaling), 1e-9);
  const auto step = query::all().separation(min_distance).clearance(default_clearance, share).passes(detail::step_filter::passes, &filter);
  double fraction = 0;
  try {
    fraction = of.detector().advance_fraction(of.scene(), step);
  } catch (const error &failed) {
    // Only what is refused may be a seam. There may be no memory, or the question was cancelled.
    if (failed.status() != IMPINGE_ERROR_INVALID) throw;
    // Parts that have come to touch at a vertex are no seam of the mesh: there is no step, as for all that touches.
    if (!of.detector().is_free(of.scene(), step)) {
      if (weld(mesh.rest_positions()).firsts.size() == mesh.num_vertices()) return 0;
      detail::refuse_seams(of, vertices_t0, step);
    }
    throw;
  }
  filter.rethrow();
  return fraction;
}

/// Finds the pairs that ipc-toolkit asks for. In two dimensions ipc-toolkit's own default does. Without a `reuse_margin` of the caller's, near
/// pairs are listed with one of a quarter of their distance. Several threads may ask for candidates of one object at once, in three dimensions.
/// Before `build`, after `clear` and after a `build` that failed there are no candidates to ask for: that throws.
class BroadPhase : public ::ipc::BroadPhase {
public:
  explicit BroadPhase(ipc::mode of = mode::exact, settings how = backend::cpu) : mode_(of), known_(std::move(how)) {}

  std::string name() const override { return mode_ == mode::exact ? "impinge" : "impinge (boxes)"; }

  using ::ipc::BroadPhase::build;
  void build(Eigen::ConstRef<Eigen::MatrixXd> vertices, Eigen::ConstRef<Eigen::MatrixXi> edges, Eigen::ConstRef<Eigen::MatrixXi> faces,
             const double inflation_radius = 0) override {
    if (vertices.cols() == 2) return flat_with([&](::ipc::BroadPhase &flat) { flat.build(vertices, edges, faces, inflation_radius); });
    auto &of = start(vertices.rows(), edges, faces, inflation_radius);
    of.place(vertices);
    bodies_ = &of;
    is_still_ = true;
  }
  void build(Eigen::ConstRef<Eigen::MatrixXd> vertices_t0, Eigen::ConstRef<Eigen::MatrixXd> vertices_t1, Eigen::ConstRef<Eigen::MatrixXi> edges,
             Eigen::ConstRef<Eigen::MatrixXi> faces, const double inflation_radius = 0) override {
    if (vertices_t0.cols() == 2) return flat_with([&](::ipc::BroadPhase &flat) { flat.build(vertices_t0, vertices_t1, edges, faces, inflation_radius); });
    auto &of = start(vertices_t0.rows(), edges, faces, inflation_radius);
    of.place(vertices_t0, vertices_t1);
    low_ = vertices_t0.cwiseMin(vertices_t1);
    high_ = vertices_t0.cwiseMax(vertices_t1);
    bodies_ = &of;
  }
  /// Of boxes alone, candidates are pairs of boxes, whatever the mode.
  void build(const ::ipc::AABBs &boxes, Eigen::ConstRef<Eigen::MatrixXi> edges, Eigen::ConstRef<Eigen::MatrixXi> faces, const uint8_t dimension) override {
    if (dimension == 2) return flat_with([&](::ipc::BroadPhase &flat) { flat.build(boxes, edges, faces, dimension); });
    const auto n = static_cast<Eigen::Index>(boxes.size());
    auto &of = start(n, edges, faces, 0);
    // A vertex that moves from one corner of its box to the other has this box.
    Eigen::MatrixXd low(n, 3), high(n, 3);
    for (Eigen::Index v = 0; v < n; ++v) {
      low.row(v) = boxes[static_cast<std::size_t>(v)].min.transpose();
      high.row(v) = boxes[static_cast<std::size_t>(v)].max.transpose();
    }
    of.place(low, high, "boxes", "boxes");
    bodies_ = &of;
    are_boxes_ = true;
  }

  void clear() override {
    ::ipc::BroadPhase::clear();
    bodies_ = nullptr;
    flat_.reset();
    near_ = {};
    impacts_.clear();
    is_still_ = are_boxes_ = false;
  }

  void detect_vertex_vertex_candidates(std::vector<::ipc::VertexVertexCandidate> &found) const override {
    if (flat_) return flat().detect_vertex_vertex_candidates(found);
    each(pair_kind::vv, 0, 0, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(a, b); });
  }
  void detect_edge_vertex_candidates(std::vector<::ipc::EdgeVertexCandidate> &found) const override {
    if (flat_) return flat().detect_edge_vertex_candidates(found);
    each(pair_kind::ev, 1, 0, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(a, b); });
  }
  void detect_edge_edge_candidates(std::vector<::ipc::EdgeEdgeCandidate> &found) const override {
    if (flat_) return flat().detect_edge_edge_candidates(found);
    each(pair_kind::ee, 1, 1, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(a, b); });
  }
  void detect_face_vertex_candidates(std::vector<::ipc::FaceVertexCandidate> &found) const override {
    if (flat_) return flat().detect_face_vertex_candidates(found);
    each(pair_kind::vf, 0, 2, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(b, a); });
  }
  void detect_edge_face_candidates(std::vector<::ipc::EdgeFaceCandidate> &found) const override {
    if (flat_) return flat().detect_edge_face_candidates(found);
    each(pair_kind::ef, 1, 2, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(a, b); });
  }
  void detect_face_face_candidates(std::vector<::ipc::FaceFaceCandidate> &found) const override {
    if (flat_) return flat().detect_face_face_candidates(found);
    each(pair_kind::ff, 2, 2, [&](::ipc::index_t a, ::ipc::index_t b) { found.emplace_back(a, b); });
  }

private:
  template <class Build> void flat_with(Build build) {
    clear();
    auto flat = ::ipc::make_default_broad_phase();
    build(*flat);
    flat_ = std::move(flat);
    dim = 2;
  }
  const ::ipc::BroadPhase &flat() const {
    flat_->can_vertices_collide = can_vertices_collide;
    return *flat_;
  }
  detail::bodies &start(Eigen::Index n, Eigen::ConstRef<Eigen::MatrixXi> edges, Eigen::ConstRef<Eigen::MatrixXi> faces, double inflation_radius) {
    clear();
    if (!(std::isfinite(inflation_radius) && inflation_radius >= 0))
      detail::refuse("inflation_radius: ", inflation_radius, " given, a finite number of 0 or more allowed");
    inflation_ = inflation_radius;
    dim = 3;
    return known_.of(n, edges, faces);
  }

  /// Whether the inflated boxes of two elements overlap in a step.
  bool boxes_meet(view<int> a, view<int> b) const {
    const auto box = [&](view<int> of) {
      std::array<Eigen::RowVector3d, 2> ends{low_.row(of[0]), high_.row(of[0])};
      for (const int v : of) {
        ends[0] = ends[0].cwiseMin(low_.row(v));
        ends[1] = ends[1].cwiseMax(high_.row(v));
      }
      return ends;
    };
    const auto [low_a, high_a] = box(a);
    const auto [low_b, high_b] = box(b);
    return (low_a - high_b).cwiseMax(low_b - high_a).maxCoeff() <= 2 * inflation_ * slack;
  }

  /// Hands out the pairs of one kind that share no vertex and pass the filter.
  template <class Found> void each(pair_kind kind, int part_a, int part_b, Found found) const {
    // No pairs would say that nothing is near.
    if (bodies_ == nullptr) detail::refuse("BroadPhase: nothing is built: build it first, also after clear() and after a build that failed");
    const bool is_of_step = kind == pair_kind::vf || kind == pair_kind::ee || (!bodies_->has_faces() && kind != pair_kind::ef && kind != pair_kind::ff);
    // Edges and faces, and faces and faces, are near where others are: their boxes are all that is asked for.
    const bool asks_boxes = mode_ == mode::boxes || are_boxes_ || !is_of_step, tests_boxes = !asks_boxes && !is_still_;
    const auto hand_out = [&](const auto &row) {
      const auto &of = *bodies_;
      if (!of.is_asked(part_a, row.body_a, row.element_a) || !of.is_asked(part_b, row.body_b, row.element_b)) return;
      auto a = of.number(part_a, row.body_a, row.element_a), b = of.number(part_b, row.body_b, row.element_b);
      // Pairs come in the order of bodies.
      if (part_a == part_b && b < a) std::swap(a, b);
      std::array<int, 3> room_a{}, room_b{};
      const auto corners_a = of.corners(part_a, a, room_a), corners_b = of.corners(part_b, b, room_b);
      if (detail::share_vertex(corners_a, corners_b) || (tests_boxes && !boxes_meet(corners_a, corners_b))) return;
      if (!detail::may_collide(corners_a, corners_b, can_vertices_collide)) return;
      found(static_cast<::ipc::index_t>(a), static_cast<::ipc::index_t>(b));
    };
    const auto all = [&](const auto &rows) { std::for_each(rows.begin(), rows.end(), hand_out); };
    auto &on = bodies_->detector();
    std::unique_lock<std::mutex> asks(bodies_->asked);
    if (asks_boxes) {
      const auto found = on.candidates(bodies_->scene(), inflation_, query::all().kinds({kind}));
      asks.unlock();
      return all(found);
    }
    if (is_still_) {
      if (!near_) near_ = bodies_->near(2 * inflation_ * slack, query::all().kinds({pair_kind::vf, pair_kind::ee, pair_kind::ev, pair_kind::vv}));
      asks.unlock();
      return all(near_->of(kind));
    }
    // Of faces and vertices and of edges and edges there is one search.
    const bool is_both = kind == pair_kind::vf || kind == pair_kind::ee;
    auto &step = impacts_[is_both ? pair_kind::vf : kind];
    if (!step) {
      const auto kinds = is_both ? query::all().kinds({pair_kind::vf, pair_kind::ee}) : query::all().kinds({kind});
      step = on.impacts(bodies_->scene(), query(kinds).separation(by_axes * (2 * inflation_ + kept_in_steps)));
    }
    asks.unlock();
    all(step->of(kind));
  }

  ipc::mode mode_;
  mutable detail::known_bodies known_;
  mutable detail::bodies *bodies_ = nullptr;
  std::unique_ptr<::ipc::BroadPhase> flat_;
  Eigen::MatrixXd low_, high_;
  double inflation_ = 0;
  bool is_still_ = false, are_boxes_ = false;
  mutable std::optional<near_pairs> near_;
  mutable std::map<pair_kind, std::optional<impacts>> impacts_;
};

/// The exact first contact of one pair. What a pair keeps is as in `compute_collision_free_stepsize`.
class NarrowPhaseCCD : public ::ipc::NarrowPhaseCCD {
public:
  NarrowPhaseCCD() { conservative_rescaling = default_rescaling; }

  bool point_point_ccd(Eigen::ConstRef<::ipc::VectorMax3d> p0_t0, Eigen::ConstRef<::ipc::VectorMax3d> p1_t0, Eigen::ConstRef<::ipc::VectorMax3d> p0_t1,
                       Eigen::ConstRef<::ipc::VectorMax3d> p1_t1, double &toi, const double min_distance = 0.0, const double tmax = 1.0) const override {
    return ask<2>(pair_kind::vv, {wide(p0_t0), wide(p1_t0)}, {wide(p0_t1), wide(p1_t1)}, toi, min_distance, tmax);
  }
  bool point_edge_ccd(Eigen::ConstRef<::ipc::VectorMax3d> p_t0, Eigen::ConstRef<::ipc::VectorMax3d> e0_t0, Eigen::ConstRef<::ipc::VectorMax3d> e1_t0,
                      Eigen::ConstRef<::ipc::VectorMax3d> p_t1, Eigen::ConstRef<::ipc::VectorMax3d> e0_t1, Eigen::ConstRef<::ipc::VectorMax3d> e1_t1,
                      double &toi, const double min_distance = 0.0, const double tmax = 1.0) const override {
    return ask<3>(pair_kind::ev, {wide(e0_t0), wide(e1_t0), wide(p_t0)}, {wide(e0_t1), wide(e1_t1), wide(p_t1)}, toi, min_distance, tmax);
  }
  bool point_triangle_ccd(Eigen::ConstRef<Eigen::Vector3d> p_t0, Eigen::ConstRef<Eigen::Vector3d> t0_t0, Eigen::ConstRef<Eigen::Vector3d> t1_t0,
                          Eigen::ConstRef<Eigen::Vector3d> t2_t0, Eigen::ConstRef<Eigen::Vector3d> p_t1, Eigen::ConstRef<Eigen::Vector3d> t0_t1,
                          Eigen::ConstRef<Eigen::Vector3d> t1_t1, Eigen::ConstRef<Eigen::Vector3d> t2_t1, double &toi, const double min_distance = 0.0,
                          const double tmax = 1.0) const override {
    return ask<4>(pair_kind::vf, {wide(p_t0), wide(t0_t0), wide(t1_t0), wide(t2_t0)}, {wide(p_t1), wide(t0_t1), wide(t1_t1), wide(t2_t1)}, toi, min_distance,
                  tmax);
  }
  bool edge_edge_ccd(Eigen::ConstRef<Eigen::Vector3d> ea0_t0, Eigen::ConstRef<Eigen::Vector3d> ea1_t0, Eigen::ConstRef<Eigen::Vector3d> eb0_t0,
                     Eigen::ConstRef<Eigen::Vector3d> eb1_t0, Eigen::ConstRef<Eigen::Vector3d> ea0_t1, Eigen::ConstRef<Eigen::Vector3d> ea1_t1,
                     Eigen::ConstRef<Eigen::Vector3d> eb0_t1, Eigen::ConstRef<Eigen::Vector3d> eb1_t1, double &toi, const double min_distance = 0.0,
                     const double tmax = 1.0) const override {
    return ask<4>(pair_kind::ee, {wide(ea0_t0), wide(ea1_t0), wide(eb0_t0), wide(eb1_t0)}, {wide(ea0_t1), wide(ea1_t1), wide(eb0_t1), wide(eb1_t1)}, toi,
                  min_distance, tmax);
  }

private:
  using point = std::array<double, 3>;
  template <class V> static point wide(const V &p) { return {p(0), p(1), p.size() > 2 ? p(2) : 0}; }
  template <std::size_t n>
  bool ask(pair_kind kind, const std::array<point, n> &from, const std::array<point, n> &to, double &toi, double min_distance, double tmax) const {
    const auto raw = query::all().separation(min_distance).clearance(default_clearance, ipc::detail::share_kept(conservative_rescaling)).raw();
    double time = 0;
    std::int32_t found = 0;
    impinge::detail::give(
        impinge_first_contact(static_cast<std::uint32_t>(kind), rows(from[0].data(), n), rows(to[0].data(), n), &raw, &time, &found));
    if (found == 0 || time > tmax) return false;
    toi = time;
    return true;
  }
};

} // namespace ipc
} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_IPC_HPP
