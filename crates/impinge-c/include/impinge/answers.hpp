/// impinge/answers.hpp: the answers of a detector. Part of impinge.hpp, which says how to use it.
#ifndef IMPINGE_ANSWERS_HPP
#define IMPINGE_ANSWERS_HPP

#include <impinge/scene.hpp>

namespace impinge {
inline namespace IMPINGE_MODE {

namespace detail {
/// What an answer cost; of none, numbers that are 0 and empty strings.
template <class Call, class Handle> impinge_stats stats_of(Call call, const Handle *of) {
  impinge_stats stats{};
  stats.size = sizeof stats;
  if (call(of, &stats) != IMPINGE_OK) {
    stats = {};
    stats.backend = stats.method = "";
  }
  return stats;
}
} // namespace detail

/// What an answer has: rows, a hash, columns, and what it cost.
template <class Handle, class Row, auto count_of, auto data_of, auto column_of, auto of_stats, auto destroy> class answer {
public:
  using value_type = Row;
  answer() = default;
  explicit answer(Handle *handle) : handle_(handle, detail::deleter<destroy>()) {}
  // What it has is not copied by accident.
  answer(answer &&) noexcept = default;
  answer &operator=(answer &&) noexcept = default;
  std::size_t size() const noexcept { return count_of(raw()); }
  bool empty() const noexcept { return size() == 0; }
  const Row *data() const & noexcept { return data_of(raw()); }
  const Row *begin() const & noexcept { return data(); }
  const Row *end() const & noexcept { return data() + size(); }
  const Row &operator[](std::size_t ix) const & { return data()[ix]; }
  Row operator[](std::size_t ix) const && { return data_of(raw())[ix]; }
  view<Row> rows() const & noexcept { return {data(), size()}; }
  /// IMPINGE_COLUMN_KIND and so on.
  result<array> column(std::uint32_t column) const & {
    array view{};
    return detail::give(column_of(raw(), column, &view), std::move(view));
  }
  /// Its strings live as long as this answer.
  impinge_stats stats() const & { return detail::stats_of(of_stats, raw()); }
  Handle *raw() noexcept { return handle_.get(); }
  const Handle *raw() const noexcept { return handle_.get(); }
  /// Keeps what the answer has, whatever becomes of it.
  std::shared_ptr<const Handle> shared() const noexcept { return handle_; }
  // A temporary ends before its views are read.
  void data() const && = delete;
  void begin() const && = delete;
  void end() const && = delete;
  void rows() const && = delete;
  void column(std::uint32_t) const && = delete;
  void stats() const && = delete;

protected:
  /// A column of packed numbers; nothing if it was not asked for.
  template <class T> view<T> packed(std::uint32_t column) const & {
    array view{};
    if (column_of(raw(), column, &view) != IMPINGE_OK) return {};
    return {static_cast<const T *>(view.data), view.rows};
  }

private:
  std::shared_ptr<Handle> handle_;
};

namespace detail {
using pairs_answer = answer<impinge_pairs, pair, impinge_pairs_count, impinge_pairs_data, impinge_pairs_column, impinge_pairs_stats, impinge_pairs_destroy>;
using impacts_answer =
    answer<impinge_impacts, impact, impinge_impacts_count, impinge_impacts_data, impinge_impacts_column, impinge_impacts_stats, impinge_impacts_destroy>;
using candidates_answer = answer<impinge_candidates, pair, impinge_candidates_count, impinge_candidates_data, impinge_candidates_column,
                                 impinge_candidates_stats, impinge_candidates_destroy>;
using near_answer = answer<impinge_near, pair, impinge_near_count, impinge_near_data, impinge_near_column, impinge_near_stats, impinge_near_destroy>;
using contacts_answer = answer<impinge_contacts, pair, impinge_contacts_count, impinge_contacts_data, impinge_contacts_column, impinge_contacts_stats,
                               impinge_contacts_destroy>;
using penetration_answer = answer<impinge_penetration, region, impinge_penetration_count, impinge_penetration_data, impinge_penetration_column,
                                  impinge_penetration_stats, impinge_penetration_destroy>;

using closest_answer = answer<impinge_closest, closest_element, impinge_closest_count, impinge_closest_data, impinge_closest_column, impinge_closest_stats,
                              impinge_closest_destroy>;
using hits_answer = answer<impinge_hits, ray_hit, impinge_hits_count, impinge_hits_data, impinge_hits_column, impinge_hits_stats, impinge_hits_destroy>;

/// The rows of one kind, of rows that are sorted by kind.
template <class Row> view<Row> of_kind(view<Row> rows, view<std::uint8_t> kinds, pair_kind kind) {
  std::size_t first = 0, last = rows.size();
  while (first < last && kinds[first] < static_cast<std::uint32_t>(kind)) ++first;
  while (last > first && kinds[last - 1] > static_cast<std::uint32_t>(kind)) --last;
  return {rows.data() + first, last - first};
}
} // namespace detail

/// Which rows of an older answer another one also has, which are new, and which are gone; all ascend.
class changes {
public:
  changes() = default;
  explicit changes(impinge_changes *handle) : handle_(handle) {}
  /// The row in the old answer, and the row in the new one.
  view<std::array<std::uint64_t, 2>> kept() const & { return column<std::array<std::uint64_t, 2>>(IMPINGE_COLUMN_KEPT); }
  /// Rows of the new answer.
  view<std::uint64_t> added() const & { return column<std::uint64_t>(IMPINGE_COLUMN_NEW); }
  /// Rows of the old answer.
  view<std::uint64_t> gone() const & { return column<std::uint64_t>(IMPINGE_COLUMN_GONE); }
  /// Whether both answers have the same pairs.
  bool empty() const { return added().empty() && gone().empty(); }
  const impinge_changes *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void kept() const && = delete;
  void added() const && = delete;
  void gone() const && = delete;

private:
  template <class T> view<T> column(std::uint32_t column) const & {
    array rows{};
    if (impinge_changes_column(raw(), column, &rows) != IMPINGE_OK) return {};
    return {static_cast<const T *>(rows.data), rows.rows};
  }
  detail::handle<impinge_changes, impinge_changes_destroy> handle_;
};

namespace detail {
template <class Call, class Handle> result<changes> changes_of(Call call, const Handle *of, const Handle *old) {
  made<impinge_changes> made;
  const auto status = call(of, old, made.out());
  return give(status, changes(made.take()));
}
} // namespace detail

/// Sorted pairs of elements that intersect.
class pairs : public detail::pairs_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_pairs_hash(raw()); }
  /// Which pairs an older answer also has, which are new, and which are gone.
  result<impinge::changes> changes(const pairs &old) const { return detail::changes_of(impinge_pairs_changes, raw(), old.raw()); }
  /// The elements of `a` and of `b` of each pair of these two bodies.
  std::vector<std::array<std::uint32_t, 2>> between(body a, body b) const {
    std::vector<std::array<std::uint32_t, 2>> found;
    for (const auto &row : *this) {
      if (a < b && row.body_a == a && row.body_b == b) found.push_back({row.element_a, row.element_b});
      if (b < a && row.body_a == b && row.body_b == a) found.push_back({row.element_b, row.element_a});
    }
    return found;
  }
  /// Pairs of elements of one body, the lower one first.
  std::vector<std::array<std::uint32_t, 2>> self_of(body of) const {
    std::vector<std::array<std::uint32_t, 2>> found;
    for (const auto &row : *this)
      if (row.body_a == of && row.body_b == of) found.push_back({row.element_a, row.element_b});
    return found;
  }
};

/// Sorted pairs that touch during a step.
class impacts : public detail::impacts_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_impacts_hash(raw()); }
  /// Which pairs an older answer also has, which are new, and which are gone.
  result<impinge::changes> changes(const impacts &old) const { return detail::changes_of(impinge_impacts_changes, raw(), old.raw()); }
  /// Whether elements intersect at the start; nothing if nobody asked.
  std::optional<bool> start_intersects() const { return detail::asked(impinge_impacts_start_intersects(raw())); }
  /// Those of one kind.
  view<impact> of(pair_kind kind) const & {
    const auto bit = static_cast<std::uint32_t>(kind);
    auto first = begin(), last = end();
    while (first != last && first->kind < bit) ++first;
    while (last != first && (last - 1)->kind > bit) --last;
    return {first, static_cast<std::size_t>(last - first)};
  }
  // A temporary ends before its views are read.
  void of(pair_kind) const && = delete;
};

/// Sorted pairs whose boxes overlap.
class candidates : public detail::candidates_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_candidates_hash(raw()); }
  /// The kind of each, as the number of a `pair_kind`.
  view<std::uint8_t> kinds() const & { return packed<std::uint8_t>(IMPINGE_COLUMN_KIND); }
  view<pair> of(pair_kind kind) const & { return detail::of_kind(rows(), kinds(), kind); }
  // A temporary ends before its views are read.
  void kinds() const && = delete;
  void of(pair_kind) const && = delete;
};

/// Up to four vertices per near pair or contact, and how their squared distance depends on them. Columns are computed when first looked at.
class stencils {
public:
  stencils() = default;
  explicit stencils(impinge_stencils *handle) : handle_(handle) {}
  /// One per contact: features that several pairs share once, with the sum of their weights.
  result<stencils> merged() const {
    detail::made<impinge_stencils> made;
    const auto status = impinge_stencils_merged(raw(), made.out());
    return detail::give(status, stencils(made.take()));
  }
  std::size_t size() const noexcept { return impinge_stencils_count(raw()); }
  bool empty() const noexcept { return size() == 0; }
  view<std::array<std::uint32_t, 4>> vertices() const & { return column<std::array<std::uint32_t, 4>>(IMPINGE_COLUMN_VERTICES); }
  /// The number of the first vertex of each body, and the number of all.
  view<std::uint64_t> starts() const & { return column<std::uint64_t>(IMPINGE_COLUMN_STARTS); }
  view<std::uint8_t> kinds() const & { return column<std::uint8_t>(IMPINGE_COLUMN_KIND); }
  view<std::array<std::uint8_t, 2>> features() const & { return column<std::array<std::uint8_t, 2>>(IMPINGE_COLUMN_FEATURES); }
  view<double> weights() const & { return column<double>(IMPINGE_COLUMN_WEIGHT); }
  view<std::array<double, 4>> coefficients() const & { return column<std::array<double, 4>>(IMPINGE_COLUMN_COEFFICIENTS); }
  view<double> squared_distances() const & { return column<double>(IMPINGE_COLUMN_SQUARED_DISTANCE); }
  view<std::array<double, 12>> gradients() const & { return column<std::array<double, 12>>(IMPINGE_COLUMN_GRADIENT); }
  view<std::array<std::array<double, 12>, 12>> hessians() const & { return column<std::array<std::array<double, 12>, 12>>(IMPINGE_COLUMN_HESSIAN); }
  view<double> mollifiers() const & { return column<double>(IMPINGE_COLUMN_MOLLIFIER); }
  view<std::array<double, 12>> mollifier_gradients() const & { return column<std::array<double, 12>>(IMPINGE_COLUMN_MOLLIFIER_GRADIENT); }
  view<std::array<std::array<double, 12>, 12>> mollifier_hessians() const & {
    return column<std::array<std::array<double, 12>, 12>>(IMPINGE_COLUMN_MOLLIFIER_HESSIAN);
  }
  const impinge_stencils *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void vertices() const && = delete;
  void starts() const && = delete;
  void kinds() const && = delete;
  void features() const && = delete;
  void weights() const && = delete;
  void coefficients() const && = delete;
  void squared_distances() const && = delete;
  void gradients() const && = delete;
  void hessians() const && = delete;
  void mollifiers() const && = delete;
  void mollifier_gradients() const && = delete;
  void mollifier_hessians() const && = delete;

private:
  template <class T> view<T> column(std::uint32_t column) const & {
    array rows{};
    if (impinge_stencils_column(raw(), column, &rows) != IMPINGE_OK) return {};
    return {static_cast<const T *>(rows.data), rows.rows};
  }
  detail::handle<impinge_stencils, impinge_stencils_destroy> handle_;
};

/// Sorted pairs of elements that are near each other.
class near_pairs : public detail::near_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_near_hash(raw()); }
  /// Which pairs an older answer also has, which are new, and which are gone.
  result<impinge::changes> changes(const near_pairs &old) const { return detail::changes_of(impinge_near_changes, raw(), old.raw()); }
  view<std::uint8_t> kinds() const & { return packed<std::uint8_t>(IMPINGE_COLUMN_KIND); }
  view<pair> of(pair_kind kind) const & { return detail::of_kind(rows(), kinds(), kind); }
  /// The nearest features of `a` and of `b`: see IMPINGE_COLUMN_FEATURES.
  view<std::array<std::uint8_t, 2>> features() const & { return packed<std::array<std::uint8_t, 2>>(IMPINGE_COLUMN_FEATURES); }
  /// With `query::distances`.
  view<double> distances() const & { return packed<double>(IMPINGE_COLUMN_DISTANCE); }
  /// With `query::closest_points`: a point of `a`, and one of `b`.
  view<std::array<std::array<double, 3>, 2>> closest_points() const & { return packed<std::array<std::array<double, 3>, 2>>(IMPINGE_COLUMN_POINTS); }
  /// What a potential needs to know about each pair, at the positions that the scene has now. Ask for near pairs of the kinds {vf, ee}: by
  /// default there are also pairs of an edge and a face that meet, which have no stencil and are refused.
  result<impinge::stencils> stencils(const scene &in) const { return stencils_of(in, nullptr); }
  /// With the mollifier of nearly parallel edges, from positions at rest: of all vertices of all bodies of the scene, one body after another,
  /// whatever bodies the pairs are of. If rows are missing, the message names the first body without enough of them.
  template <class P> result<impinge::stencils> stencils(const scene &in, const P &rest) const {
    const array rows = detail::rows_of(rest, 3);
    return stencils_of(in, &rows);
  }
  /// The same, weighted by area: see impinge_near_stencils_by_area.
  template <class P> result<impinge::stencils> stencils_by_area(const scene &in, const P &rest) const {
    const array rows = detail::rows_of(rest, 3);
    return stencils_of(in, &rows, impinge_near_stencils_by_area);
  }
  // A temporary ends before its views are read.
  void kinds() const && = delete;
  void of(pair_kind) const && = delete;
  void features() const && = delete;
  void distances() const && = delete;
  void closest_points() const && = delete;

private:
  result<impinge::stencils> stencils_of(const scene &in, const array *rest, decltype(impinge_near_stencils) *call = impinge_near_stencils) const {
    detail::made<impinge_stencils> made;
    const auto status = call(raw(), in.raw(), rest, made.out());
    return detail::give(status, impinge::stencils(made.take()));
  }
};

/// Where the triangles of each pair meet. Points are one if they have one name, by features: where a face is there twice, or faces of one
/// body overlap in a plane, points and curves double, and what they would connect can be several regions.
class contacts : public detail::contacts_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_contacts_hash(raw()); }
  /// Where they meet; corners and curves name these points by their numbers.
  view<std::array<double, 3>> points() const & { return packed<std::array<double, 3>>(IMPINGE_COLUMN_CONTACT_POINTS); }
  /// The corners of contact i are those from `starts()[i]` to `starts()[i + 1]`.
  view<std::uint64_t> starts() const & { return packed<std::uint64_t>(IMPINGE_COLUMN_STARTS); }
  view<std::uint32_t> corners() const & { return packed<std::uint32_t>(IMPINGE_COLUMN_CORNERS); }
  /// The points of curve i are those from `curve_starts()[i]` to `curve_starts()[i + 1]`.
  view<std::uint64_t> curve_starts() const & { return packed<std::uint64_t>(IMPINGE_COLUMN_CURVE_STARTS); }
  view<std::uint32_t> curve_points() const & { return packed<std::uint32_t>(IMPINGE_COLUMN_CURVE_POINTS); }
  view<std::uint8_t> curve_closed() const & { return packed<std::uint8_t>(IMPINGE_COLUMN_CURVE_CLOSED); }
  view<double> curve_lengths() const & { return packed<double>(IMPINGE_COLUMN_CURVE_LENGTH); }
  // A temporary ends before its views are read.
  void points() const && = delete;
  void starts() const && = delete;
  void corners() const && = delete;
  void curve_starts() const && = delete;
  void curve_points() const && = delete;
  void curve_closed() const && = delete;
  void curve_lengths() const && = delete;
};

/// How deep two closed bodies are in each other: one row per region.
class penetration : public detail::penetration_answer {
public:
  using answer::answer;
  /// NaN if that of any region is unknown: see `impinge_region`. Infinite if larger than all floats, unknown if infinite regions cancel.
  double volume() const noexcept { return impinge_penetration_volume(raw()); }
  /// Vertices of the body with the lower number inside the other, and of the other inside that, whichever was named first.
  view<std::uint32_t> inside_a() const & { return packed<std::uint32_t>(IMPINGE_COLUMN_INSIDE_A); }
  view<std::uint32_t> inside_b() const & { return packed<std::uint32_t>(IMPINGE_COLUMN_INSIDE_B); }
  // A temporary ends before its views are read.
  void inside_a() const && = delete;
  void inside_b() const && = delete;
};

/// The elements nearest to points, one row per point, or `n_nearest()` of them: `found` of a row is 0 where nothing is near enough.
class closest : public detail::closest_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_closest_hash(raw()); }
  /// How many rows each point has: what the query said.
  std::size_t n_nearest() const noexcept { return impinge_closest_n_nearest(raw()); }
  /// What is nearest to a point, nearest first: as many elements as were asked for, or fewer if no more are near enough.
  view<closest_element> of(std::size_t point) const & {
    const std::size_t n = n_nearest();
    if (n == 0 || point >= size() / n) return {};
    const closest_element *first = data() + point * n;
    std::size_t n_found = 0;
    while (n_found < n && first[n_found].found != 0) ++n_found;
    return {first, n_found};
  }
  // A temporary ends before its views are read.
  void of(std::size_t) const && = delete;
};

/// What rays hit, one ray after the other.
class hits : public detail::hits_answer {
public:
  using answer::answer;
  std::uint64_t hash() const noexcept { return impinge_hits_hash(raw()); }
  std::size_t n_rays() const noexcept { return impinge_hits_n_rays(raw()); }
  /// Of each ray: 1 if it hits anything.
  view<std::uint8_t> is_hit() const & { return packed<std::uint8_t>(IMPINGE_COLUMN_IS_HIT); }
  /// The hits of ray i are those from `starts()[i]` to `starts()[i + 1]`; nothing if only yes or no was asked for.
  view<std::uint64_t> starts() const & { return packed<std::uint64_t>(IMPINGE_COLUMN_STARTS); }
  /// What a ray hits: the first, or all.
  view<ray_hit> of(std::size_t ray) const & {
    const auto at = starts();
    if (ray + 1 >= at.size()) return {};
    return {data() + at[ray], static_cast<std::size_t>(at[ray + 1] - at[ray])};
  }
  // A temporary ends before its views are read.
  void is_hit() const && = delete;
  void starts() const && = delete;
  void of(std::size_t) const && = delete;
};

/// How far each vertex may move, on any path, so that nothing touches.
class safe_distances {
public:
  safe_distances() = default;
  explicit safe_distances(impinge_safe_distances *handle) : handle_(handle) {}
  /// Those of a body, in the precision of its positions.
  result<array> of(body of) const & {
    array view{};
    return detail::give(impinge_safe_distances_of(raw(), of, &view), std::move(view));
  }
  /// The pairs at distance 0 (also those nearer than the smallest double), or at most as far apart as their bodies are thick, whose vertices
  /// may not move at all.
  view<pair> touching() const & noexcept {
    const auto *touching = impinge_safe_distances_touching(raw());
    return {impinge_near_data(touching), impinge_near_count(touching)};
  }
  impinge_stats stats() const & { return detail::stats_of(impinge_safe_distances_stats, raw()); }
  const impinge_safe_distances *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void of(body) const && = delete;
  void touching() const && = delete;
  void stats() const && = delete;

private:
  detail::handle<impinge_safe_distances, impinge_safe_distances_destroy> handle_;
};

/// Lists: the neighbours of element i are those from `offsets[i]` to `offsets[i + 1]`, ascending, each with its distance rounded down.
struct csr {
  view<std::uint64_t> offsets;
  view<std::uint32_t> indices;
  view<double> distances;
};

/// Which elements are near each element.
class neighbours {
public:
  neighbours() = default;
  explicit neighbours(impinge_neighbours *handle) : handle_(handle) {}
  /// How many pairs are near; each is in two lists.
  std::size_t size() const noexcept { return impinge_neighbours_count(raw()); }
  bool empty() const noexcept { return size() == 0; }
  /// The numbers of the first vertex, the first edge and the first face of a body in the lists, which number those of all bodies.
  result<std::array<std::uint32_t, 3>> first(body of) const {
    std::uint32_t first[3] = {0, 0, 0};
    const auto status = impinge_neighbours_first(raw(), of, &first);
    return detail::give(status, std::array<std::uint32_t, 3>{first[0], first[1], first[2]});
  }
  /// The lists of the elements that a kind names first, and of those that it names second.
  csr of(pair_kind kind) const & { return lists(kind, 0); }
  csr reversed(pair_kind kind) const & { return lists(kind, 1); }
  /// The faces near each vertex, the vertices near each face, the edges near each edge.
  csr vf() const & { return of(pair_kind::vf); }
  csr fv() const & { return reversed(pair_kind::vf); }
  csr ee() const & { return of(pair_kind::ee); }
  /// The distances of lists in single precision, rounded down once more: `of(kind)`, or `reversed(kind)`.
  std::vector<float> distances_f32(pair_kind kind, bool reversed = false) const {
    std::vector<float> distances(lists(kind, reversed).distances.size());
    impinge_neighbours_distances_f32(raw(), static_cast<std::uint32_t>(kind), reversed, distances.data(), distances.size());
    return distances;
  }
  impinge_stats stats() const & { return detail::stats_of(impinge_neighbours_stats, raw()); }
  const impinge_neighbours *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void of(pair_kind) const && = delete;
  void reversed(pair_kind) const && = delete;
  void vf() const && = delete;
  void fv() const && = delete;
  void ee() const && = delete;
  void stats() const && = delete;

private:
  csr lists(pair_kind kind, std::uint32_t reversed) const & {
    array offsets{}, indices{}, distances{};
    if (impinge_neighbours_lists(raw(), static_cast<std::uint32_t>(kind), reversed, &offsets, &indices, &distances) != IMPINGE_OK) return {};
    return {{static_cast<const std::uint64_t *>(offsets.data), offsets.rows},
            {static_cast<const std::uint32_t *>(indices.data), indices.rows},
            {static_cast<const double *>(distances.data), distances.rows}};
  }
  detail::handle<impinge_neighbours, impinge_neighbours_destroy> handle_;
};

/// Positions that a step can be taken to.
class motion {
public:
  motion() = default;
  explicit motion(impinge_motion *handle) : handle_(handle) {}
  std::optional<bool> start_intersects() const { return detail::asked(impinge_motion_start_intersects(raw())); }
  /// Where the vertices of a body are then; no rows for one that stands still.
  result<array> positions(body of) const & {
    array view{};
    return detail::give(impinge_motion_positions(raw(), of, &view), std::move(view));
  }
  /// Takes the step.
  result<void> apply(scene &to) const { return detail::give(impinge_motion_apply(raw(), to.raw())); }
  impinge_stats stats() const & { return detail::stats_of(impinge_motion_stats, raw()); }
  const impinge_motion *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void positions(body) const && = delete;
  void stats() const && = delete;

private:
  detail::handle<impinge_motion, impinge_motion_destroy> handle_;
};

/// How far a step can be taken.
class advance : public motion {
public:
  using motion::motion;
  /// 1 for the whole step, 0 for none.
  double fraction() const noexcept { return impinge_motion_fraction(raw()); }
  /// The first contact of the whole step. Its time is rounded down to double, whatever `query::precision` says: it may be later than that of
  /// `detector::earliest`. With a clearance: the first time at which a pair is as near as it may come, as a float, also where nothing touches.
  std::optional<impact> first() const {
    impact contact{};
    std::int32_t found = 0;
    if (impinge_motion_first(raw(), &contact, &found) != IMPINGE_OK || found == 0) return std::nullopt;
    return contact;
  }
};

/// How far each vertex can go in a step.
class truncation : public motion {
public:
  using motion::motion;
  /// How many vertices were stopped before the end of their way.
  std::uint64_t n_cut() const noexcept { return impinge_motion_n_cut(raw()); }
  /// How many pairs touch at the start, or are at most as far apart as they are to keep: their vertices were not moved. Pairs of
  /// which no vertex moves are not counted.
  std::uint64_t n_touching() const noexcept { return impinge_motion_n_touching(raw()); }
  /// How often pairs were looked at again, because vertices had been stopped.
  std::uint32_t rounds() const noexcept { return impinge_motion_rounds(raw()); }
  /// The pairs that stopped vertices, those that touch at the start included. Sorted anew by each call; their stats are empty.
  result<candidates> pairs() const {
    detail::made<impinge_candidates> made;
    const auto status = impinge_motion_pairs(raw(), made.out());
    return detail::give(status, candidates(made.take()));
  }
};

} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_ANSWERS_HPP
