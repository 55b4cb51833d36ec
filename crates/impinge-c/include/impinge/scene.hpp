/// impinge/scene.hpp: arrays, errors, queries and scenes. Part of impinge.hpp, which says how to use it.
#ifndef IMPINGE_SCENE_HPP
#define IMPINGE_SCENE_HPP

#if (defined(_MSVC_LANG) && _MSVC_LANG < 201703L) || (!defined(_MSVC_LANG) && __cplusplus < 201703L)
#error "impinge.hpp needs C++17: -std=c++17, or CXX_STANDARD 17 in CMake"
#endif

#include <impinge.h>

#include <array>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#if !defined(IMPINGE_NO_EXCEPTIONS) && !defined(__cpp_exceptions) && !defined(_CPPUNWIND)
#define IMPINGE_NO_EXCEPTIONS
#endif

// Classes differ with and without exceptions. Each mode has names of its own for the linker, so a program may have units of both.
#ifndef IMPINGE_NO_EXCEPTIONS
#define IMPINGE_MODE with_exceptions
#else
#define IMPINGE_MODE without_exceptions
#endif

// Old macros of windows.h.
#undef near

#ifndef IMPINGE_NO_EXCEPTIONS
#include <exception>
#include <stdexcept>
#endif

namespace impinge {
inline namespace IMPINGE_MODE {

/// A body of a scene.
using body = std::uint32_t;
/// Two elements: `body_a, element_a, body_b, element_b`.
using pair = impinge_pair;
/// Two elements that touch during a step.
using impact = impinge_impact;
/// The nearest elements of two bodies.
using nearest = impinge_nearest;
/// The element that is nearest to a point.
using closest_element = impinge_closest_element;
/// Where a ray meets an element.
using ray_hit = impinge_ray_hit;
/// A region in which two bodies overlap.
using region = impinge_region;
/// Rows of numbers anywhere in memory.
using array = impinge_array;

#ifndef IMPINGE_NO_EXCEPTIONS

/// A call that failed. `what()` names body, row and value.
class error : public std::runtime_error {
public:
  error(impinge_status status, const char *message) : std::runtime_error(message), status_(status) {}
  /// IMPINGE_ERROR_INVALID and so on.
  impinge_status status() const noexcept { return status_; }

private:
  impinge_status status_;
};

/// What a call gives.
template <class T> using result = T;

#else

/// Values that can be tested themselves, as numbers and bodies can: with exceptions `if (detector.count(scene))` asks whether there are any,
/// and a test of the result would ask only whether the call succeeded.
template <class T> struct is_tested_itself : std::is_arithmetic<T> {};
template <class T> struct is_tested_itself<std::optional<T>> : std::true_type {};

/// What a call gives, or why it failed.
template <class T> class [[nodiscard]] result {
public:
  result(T value) : value_(std::move(value)) {}
  result(impinge_status status, const char *message) : status_(status), message_(message) {}
  /// Whether the call succeeded, so that there is a value.
  bool ok() const noexcept { return value_.has_value(); }
  /// The same, but not where the value can be tested itself: write `any.ok() && *any`, `n.ok() && *n > 0`.
  template <class V = T, std::enable_if_t<!is_tested_itself<V>::value, int> = 0> explicit operator bool() const noexcept { return ok(); }
  template <class V = T, std::enable_if_t<is_tested_itself<V>::value, int> = 0> explicit operator bool() const = delete;
  /// The value, if there is one.
  T &operator*() & { return *value_; }
  const T &operator*() const & { return *value_; }
  T operator*() && { return std::move(*value_); }
  T *operator->() & { return &*value_; }
  const T *operator->() const & { return &*value_; }
  // A temporary ends with its value: `*detector.near(scene, 1)` moves it out.
  void operator*() const && = delete;
  void operator->() const && = delete;
  /// IMPINGE_OK, or what failed.
  impinge_status status() const noexcept { return status_; }
  const std::string &message() const & noexcept { return message_; }
  std::string message() && { return std::move(message_); }

private:
  std::optional<T> value_;
  impinge_status status_ = IMPINGE_OK;
  std::string message_;
};

template <> class [[nodiscard]] result<void> {
public:
  result() = default;
  result(impinge_status status, const char *message) : status_(status), message_(message) {}
  /// Whether the call succeeded.
  bool ok() const noexcept { return status_ == IMPINGE_OK; }
  explicit operator bool() const noexcept { return ok(); }
  impinge_status status() const noexcept { return status_; }
  const std::string &message() const & noexcept { return message_; }
  std::string message() && { return std::move(message_); }

private:
  impinge_status status_ = IMPINGE_OK;
  std::string message_;
};

#endif

/// Numbers that lie one after the other and belong to an answer. Converts to `std::span`.
template <class T> class view {
public:
  using value_type = T;
  view() = default;
  view(const T *data, std::size_t size) : data_(data), size_(size) {}
  const T *data() const noexcept { return data_; }
  std::size_t size() const noexcept { return size_; }
  bool empty() const noexcept { return size_ == 0; }
  const T *begin() const noexcept { return data_; }
  const T *end() const noexcept { return data_ + size_; }
  const T &operator[](std::size_t ix) const { return data_[ix]; }

private:
  const T *data_ = nullptr;
  std::size_t size_ = 0;
};

namespace detail {

#ifndef IMPINGE_NO_EXCEPTIONS
inline void give(impinge_status status) {
  if (status != IMPINGE_OK) throw error(status, impinge_error_message());
}
template <class T> T give(impinge_status status, T &&value) {
  give(status);
  return std::forward<T>(value);
}
[[noreturn]] inline void refuse(const char *message) { throw error(IMPINGE_ERROR_INVALID, message); }
#else
inline result<void> refuse(const char *message) { return {IMPINGE_ERROR_INVALID, message}; }
inline result<void> give(impinge_status status) {
  return status == IMPINGE_OK ? result<void>() : result<void>(status, impinge_error_message());
}
template <class T> result<std::decay_t<T>> give(impinge_status status, T &&value) {
  if (status != IMPINGE_OK) return {status, impinge_error_message()};
  return {std::forward<T>(value)};
}
#endif

/// The type code of a number.
template <class T> constexpr std::uint32_t type_of() {
  static_assert(std::is_arithmetic_v<T>, "numbers are float, double, or integers of 32 or 64 bits");
  if constexpr (sizeof(T) == 1) return IMPINGE_U8;
  else if constexpr (std::is_same_v<T, float>) return IMPINGE_F32;
  else if constexpr (std::is_same_v<T, double>) return IMPINGE_F64;
  else if constexpr (sizeof(T) == 4) return std::is_signed_v<T> ? IMPINGE_I32 : IMPINGE_U32;
  else {
    static_assert(sizeof(T) == 8, "integers have 32 or 64 bits");
    return std::is_signed_v<T> ? IMPINGE_I64 : IMPINGE_U64;
  }
}

template <auto destroy> struct deleter {
  template <class T> void operator()(T *handle) const { destroy(handle); }
};
template <class T, auto destroy> using handle = std::unique_ptr<T, deleter<destroy>>;

/// A handle that a call of C makes.
template <class T> class made {
public:
  T **out() { return &handle_; }
  T *take() { return std::exchange(handle_, nullptr); }

private:
  T *handle_ = nullptr;
};

inline std::optional<bool> asked(std::int32_t answer) {
  if (answer < 0) return std::nullopt;
  return answer != 0;
}

} // namespace detail

/// `n` rows of numbers from `data` on; `row_stride` bytes from one row to the next, or 0 for packed rows.
template <class T> array rows(const T *data, std::size_t n, std::ptrdiff_t row_stride = 0) {
  const auto column_stride = row_stride == 0 ? 0 : static_cast<std::ptrdiff_t>(sizeof(T));
  return {data, n, row_stride, column_stride, detail::type_of<T>()};
}

namespace detail {
template <class T> struct is_known : std::false_type {};
} // namespace detail

/// How objects of a type are read as rows of `columns` numbers. Specialise it for types of your own, as impinge/eigen.hpp does.
template <class T, class = void> struct as_array {
  static_assert(detail::is_known<T>::value, "no rows of numbers: give a container, an array of C, rows(pointer, n), or a matrix with impinge/eigen.hpp");
};

template <> struct as_array<array> {
  static array of(const array &given, std::size_t) { return given; }
};

namespace detail {
/// Types with `data()`, `size()` and `value_type`. Matrices of Eigen, which have a `Scalar`, are none.
template <class T, class = void> struct is_container : std::false_type {};
template <class T>
struct is_container<T, std::void_t<decltype(std::declval<const T &>().data()), decltype(std::declval<const T &>().size()), typename T::value_type>>
    : std::true_type {};
template <class T, class = void> struct has_scalar : std::false_type {};
template <class T> struct has_scalar<T, std::void_t<typename T::Scalar>> : std::true_type {};

/// Numbers, each row after the other, or rows of `n` of them.
template <class T, class = void> struct row_of {
  using number = T;
  static constexpr std::size_t n = 0;
};
template <class T, std::size_t N> struct row_of<std::array<T, N>> {
  using number = T;
  static constexpr std::size_t n = N;
};
template <class T, std::size_t N> struct row_of<T[N]> {
  using number = std::remove_cv_t<T>;
  static constexpr std::size_t n = N;
};
template <class Row> array packed_rows(const void *data, std::size_t size, std::size_t columns) {
  constexpr auto n = row_of<Row>::n;
  using number = typename row_of<Row>::number;
  static_assert(std::is_arithmetic_v<number>,
                "no rows of numbers: containers are of numbers, std::array, or arrays of C; with impinge/eigen.hpp also of vectors of Eigen of a "
                "fixed size; for structures give rows(&points[0].x, points.size(), sizeof points[0])");
  // A stride of one byte fits them.
  static_assert(n <= 1 || sizeof(number) > 1, "bytes are flags, one of each vertex, and no rows of several numbers");
  const bool fits = n > 0 ? n == columns : size % columns == 0;
  // Rows of another length make an array that the library refuses, so a row that has only begun counts: no rows at all are accepted.
  const std::ptrdiff_t stride = fits ? 0 : 1;
  // Of rows, the other stride says how long they are.
  const std::ptrdiff_t length = fits || n == 0 ? stride : -static_cast<std::ptrdiff_t>(n);
  return {data, n > 0 ? size : size / columns + (fits ? 0 : 1), stride, length, type_of<number>()};
}
} // namespace detail

/// Containers with `data()` and `size()`: of numbers (each row after the other), of `std::array`, or with impinge/eigen.hpp of `Eigen::Vector3d`
/// and others of a fixed size.
template <class T> struct as_array<T, std::enable_if_t<detail::is_container<T>::value && !detail::has_scalar<T>::value>> {
  static array of(const T &given, std::size_t columns) {
    return detail::packed_rows<std::remove_cv_t<typename T::value_type>>(given.data(), given.size(), columns);
  }
};

/// Arrays of C: of numbers (each row after the other), or of rows.
template <class T, std::size_t N> struct as_array<T[N]> {
  static array of(const T (&given)[N], std::size_t columns) { return detail::packed_rows<std::remove_cv_t<T>>(given, N, columns); }
};

/// Rows that the library gives, as their type, which is numbers, `std::array`, or a vector of Eigen that needs no alignment: `as_rows<std::array<float, 3>>(scene.positions(body))`. Without a
/// copy. Other numbers, other columns and rows that are not packed are refused.
template <class Row> result<view<Row>> as_rows(const array &of) {
  using number = typename detail::row_of<Row>::number;
  static_assert(alignof(Row) <= alignof(number), "rows of the library are aligned as their numbers are: use std::array, or Eigen::DontAlign");
  constexpr auto n = sizeof(Row) / sizeof(number), type = static_cast<std::size_t>(detail::type_of<number>());
  const bool is_packed = of.row_stride == static_cast<std::ptrdiff_t>(sizeof(Row)) && (n == 1 || of.column_stride == static_cast<std::ptrdiff_t>(sizeof(number)));
  if (of.rows > 0 && (of.type != type || !is_packed)) {
    const std::string given = "as_rows: rows of type " + std::to_string(of.type) + " with strides " + std::to_string(of.row_stride) + " and ";
    const std::string allowed = " given, packed rows of " + std::to_string(n) + " numbers of type " + std::to_string(type) + " asked for";
    const std::string message = given + std::to_string(of.column_stride) + allowed;
#ifndef IMPINGE_NO_EXCEPTIONS
    detail::refuse(message.c_str());
#else
    return {IMPINGE_ERROR_INVALID, message.c_str()};
#endif
  }
  return view<Row>(static_cast<const Row *>(of.data), of.rows);
}

namespace detail {
template <class T> array rows_of(const T &given, std::size_t columns) { return as_array<T>::of(given, columns); }
/// Whether something owns its numbers: containers, and matrices of Eigen that are no views.
template <class T, class = void> struct owns : std::false_type {};
template <class T> struct owns<T, std::void_t<typename T::allocator_type>> : std::true_type {};
template <class T> struct owns<T, std::enable_if_t<std::is_same_v<T, typename T::PlainObject>>> : std::true_type {};
template <class V, std::size_t N> struct owns<std::array<V, N>> : std::true_type {};
/// Whether a forwarded argument is a temporary whose numbers end with it.
template <class T> struct is_lost : std::bool_constant<!std::is_lvalue_reference_v<T> && owns<std::remove_cv_t<T>>::value> {};
} // namespace detail

/// What happens to pairs that touch at the start of a step.
enum class start : std::uint32_t { report = IMPINGE_START_REPORT, skip = IMPINGE_START_SKIP, verify = IMPINGE_START_VERIFY };
/// Pairs of one body that share vertices.
enum class shared_vertex : std::uint32_t { skip = IMPINGE_SKIP, resolve = IMPINGE_RESOLVE };
/// The precision of times.
enum class precision : std::uint32_t { f32 = IMPINGE_F32, f64 = IMPINGE_F64 };
/// Kinds of pairs; the first letter is the element `a`.
enum class pair_kind : std::uint32_t { vf = IMPINGE_VF, ee = IMPINGE_EE, ev = IMPINGE_EV, vv = IMPINGE_VV, ef = IMPINGE_EF, ff = IMPINGE_FF };
/// Where the work is done.
enum class backend : std::uint32_t { automatic = IMPINGE_BACKEND_AUTO, cpu = IMPINGE_BACKEND_CPU, gpu = IMPINGE_BACKEND_GPU };
/// Which hits of a ray are sought.
enum class hits_of_ray : std::uint32_t { first = IMPINGE_HITS_FIRST, any = IMPINGE_HITS_ANY, all = IMPINGE_HITS_ALL };
/// How candidates are found.
enum class method : std::uint32_t { automatic = IMPINGE_METHOD_AUTO, clusters = IMPINGE_METHOD_CLUSTERS, cells = IMPINGE_METHOD_CELLS, naive = IMPINGE_METHOD_NAIVE };

/// Which pairs, and how: one query for all questions. `impinge_query` in impinge.h describes each option. Setters return the query that they
/// change; those of a temporary return it by value.
class query {
public:
  /// Everything: pairs of different bodies and self-collision.
  query() { impinge_query_default(&raw_); }
  static query all() { return {}; }
  /// Pairs of different bodies.
  static query between_all() { return of_bodies(1, 0, IMPINGE_ANY_BODY, IMPINGE_ANY_BODY); }
  /// Self-collision of all bodies.
  static query self_all() { return of_bodies(0, 1, IMPINGE_ANY_BODY, IMPINGE_ANY_BODY); }
  /// Pairs between two bodies, whatever their filters say.
  static query between(body a, body b) { return of_bodies(1, 1, a, b); }
  /// Self-collision of one body.
  static query self_of(body a) { return of_bodies(0, 1, a, IMPINGE_ANY_BODY); }
  /// Pairs of one body and any other, whatever their filters say.
  static query of(body a) { return of_bodies(1, 0, a, IMPINGE_ANY_BODY); }

  query &kinds(std::initializer_list<pair_kind> kinds) & {
    raw_.kinds = 0;
    for (const auto kind : kinds) raw_.kinds |= static_cast<std::uint32_t>(kind);
    return *this;
  }
  query &shared_vertex(impinge::shared_vertex rule) & { return set(raw_.shared_vertex, static_cast<std::uint32_t>(rule)); }
  /// Leaves out the pairs of two bodies, or the self-collision of one.
  query &exclude(body a, body b) & { return leave_out(IMPINGE_EXCLUDE_BODIES, a, b, 0); }
  /// Leaves out pairs of one body that are at most `n` edges apart in its surface. Nothing is proven of pairs that are left out: they may
  /// pass through each other.
  query &exclude_rings(std::uint32_t n) & { return leave_out(IMPINGE_EXCLUDE_RINGS, 0, 0, n); }
  /// Leaves out pairs of elements of two groups of vertices: see `scene::set_groups`.
  query &exclude_groups(std::uint32_t g, std::uint32_t h) & { return leave_out(IMPINGE_EXCLUDE_GROUPS, g, h, 0); }
  /// Leaves out pairs of an element of `a` and one of `b` of which some vertices are listed together: the list of vertex v of `a` is
  /// vertices[offsets[v]] to vertices[offsets[v + 1] - 1], vertices of `b`. The arrays must live as long as the query is used.
  template <class O, class V> query &exclude_vertices(body a, body b, O &&offsets, V &&vertices) & {
    static_assert(!detail::is_lost<O>::value && !detail::is_lost<V>::value, "the arrays must live as long as the query: give them names");
    leave_out(IMPINGE_EXCLUDE_VERTICES, a, b, 0);
    exclusions_.back().offsets = detail::rows_of(offsets, 1);
    exclusions_.back().vertices = detail::rows_of(vertices, 1);
    return *this;
  }
  /// Leaves out the pairs of an answer of `detector::near`, such as those that are near at rest. The query keeps them, whatever becomes of the
  /// answer.
  template <class Near> query &exclude(const Near &rest_pairs) & {
    kept_.push_back(rest_pairs.shared());
    rest_pairs_.push_back(rest_pairs.raw());
    return *this;
  }
  /// Bodies that do not move, of `detector::safe_distances`.
  query &fixed(std::vector<body> bodies) & {
    fixed_ = std::move(bodies);
    return *this;
  }
  /// How many nearest elements of each point `detector::closest` gives.
  query &n_nearest(std::uint32_t n) & { return set(raw_.n_nearest, n); }
  /// Of `detector::cast`.
  query &hits(hits_of_ray which) & { return set(raw_.hits, static_cast<std::uint32_t>(which)); }
  /// Only the pairs of a half-open box of space.
  query &owned_by(const std::array<double, 3> &low, const std::array<double, 3> &high) & {
    raw_.flags |= IMPINGE_CELL;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      raw_.cell_low[axis] = low[axis];
      raw_.cell_high[axis] = high[axis];
    }
    return *this;
  }
  query &start(impinge::start rule) & { return set(raw_.start, static_cast<std::uint32_t>(rule)); }
  query &precision(impinge::precision of) & { return set(raw_.precision, static_cast<std::uint32_t>(of)); }
  /// The distance that counts as touching, a length.
  query &separation(double length) & { return set(raw_.separation, length); }
  /// What a step leaves, a length, and the share of its distance that a pair keeps at most.
  query &clearance(double length, double share = 0.2) & {
    raw_.clearance_share = share;
    return set(raw_.clearance, length);
  }
  query &distances() & { return set(raw_.flags, raw_.flags | IMPINGE_DISTANCES); }
  query &closest_points() & { return set(raw_.flags, raw_.flags | IMPINGE_CLOSEST_POINTS); }

  /// Which pairs of elements may collide, of steps: see `impinge_query`. `user` must live as long as the query is asked. Several threads call
  /// the function at the same time. It must not throw: it is called by code that cannot unwind, unlike the callbacks of `settings`. Catch
  /// within it, keep the first std::exception_ptr under a lock, return 0, and rethrow after the question.
  query &passes(int (*function)(void *user, const impinge_element *a, const impinge_element *b), void *user) & {
    raw_.passes_user = user;
    raw_.passes = function;
    return *this;
  }

  // The same of a temporary, which a reference then keeps.
  query kinds(std::initializer_list<pair_kind> of) && { return std::move(kinds(of)); }
  query shared_vertex(impinge::shared_vertex rule) && { return std::move(shared_vertex(rule)); }
  query exclude(body a, body b) && { return std::move(exclude(a, b)); }
  query exclude_rings(std::uint32_t n) && { return std::move(exclude_rings(n)); }
  query exclude_groups(std::uint32_t g, std::uint32_t h) && { return std::move(exclude_groups(g, h)); }
  template <class O, class V> query exclude_vertices(body a, body b, O &&offsets, V &&vertices) && {
    return std::move(exclude_vertices(a, b, std::forward<O>(offsets), std::forward<V>(vertices)));
  }
  template <class Near> query exclude(const Near &rest_pairs) && { return std::move(exclude(rest_pairs)); }
  query fixed(std::vector<body> bodies) && { return std::move(fixed(std::move(bodies))); }
  query n_nearest(std::uint32_t n) && { return std::move(n_nearest(n)); }
  query hits(hits_of_ray which) && { return std::move(hits(which)); }
  query owned_by(const std::array<double, 3> &low, const std::array<double, 3> &high) && { return std::move(owned_by(low, high)); }
  query start(impinge::start rule) && { return std::move(start(rule)); }
  query precision(impinge::precision of) && { return std::move(precision(of)); }
  query separation(double length) && { return std::move(separation(length)); }
  query clearance(double length, double share = 0.2) && { return std::move(clearance(length, share)); }
  query distances() && { return std::move(distances()); }
  query closest_points() && { return std::move(closest_points()); }
  query passes(int (*function)(void *user, const impinge_element *a, const impinge_element *b), void *user) && {
    return std::move(passes(function, user));
  }

  /// The query of C. It lives as long as this one is not changed.
  impinge_query raw() const {
    impinge_query raw = raw_;
    raw.exclusions = exclusions_.data();
    raw.n_exclusions = exclusions_.size();
    raw.fixed = fixed_.data();
    raw.n_fixed = fixed_.size();
    raw.rest_pairs = rest_pairs_.data();
    raw.n_rest_pairs = rest_pairs_.size();
    return raw;
  }

private:
  static query of_bodies(std::uint32_t between, std::uint32_t self, body a, body b) {
    query of;
    of.raw_.between = between;
    of.raw_.self = self;
    of.raw_.a = a;
    of.raw_.b = b;
    return of;
  }
  query &leave_out(std::uint32_t kind, std::uint32_t a, std::uint32_t b, std::uint32_t n) {
    impinge_exclusion exclusion{};
    exclusion.kind = kind;
    exclusion.a = a;
    exclusion.b = b;
    exclusion.n = n;
    exclusions_.push_back(exclusion);
    return *this;
  }
  template <class T> query &set(T &field, T value) {
    field = value;
    return *this;
  }
  impinge_query raw_;
  std::vector<impinge_exclusion> exclusions_;
  std::vector<body> fixed_;
  std::vector<const impinge_near *> rest_pairs_;
  /// Owners of these.
  std::vector<std::shared_ptr<const impinge_near>> kept_;
};

/// Bodies: topology once, positions every frame. Elements and positions are anything that `as_array` reads: vectors of numbers or of
/// `std::array`, `rows(pointer, n)`, an `impinge::array` with strides, matrices with impinge/eigen.hpp.
class scene {
public:
  scene() {
    detail::made<impinge_scene> made;
    const auto status = impinge_scene_create(made.out());
    handle_.reset(made.take());
#ifndef IMPINGE_NO_EXCEPTIONS
    detail::give(status);
#else
    (void)status; // Without a handle every call fails.
#endif
  }

  template <class F, class P> result<body> add_triangles(const F &faces, const P &positions) {
    body added = IMPINGE_ANY_BODY;
    return detail::give(impinge_scene_add_triangles(raw(), detail::rows_of(faces, 3), detail::rows_of(positions, 3), &added), std::move(added));
  }
  template <class F, class P> result<body> add_tetrahedra(const F &tetrahedra, const P &positions) {
    body added = IMPINGE_ANY_BODY;
    return detail::give(impinge_scene_add_tetrahedra(raw(), detail::rows_of(tetrahedra, 4), detail::rows_of(positions, 3), &added), std::move(added));
  }
  template <class F, class P> result<body> add_edges(const F &edges, const P &positions) {
    body added = IMPINGE_ANY_BODY;
    return detail::give(impinge_scene_add_edges(raw(), detail::rows_of(edges, 2), detail::rows_of(positions, 3), &added), std::move(added));
  }
  template <class P> result<body> add_points(const P &positions) {
    body added = IMPINGE_ANY_BODY;
    return detail::give(impinge_scene_add_points(raw(), detail::rows_of(positions, 3), &added), std::move(added));
  }
  result<void> remove(body of) { return detail::give(impinge_scene_remove(raw(), of)); }
  /// New elements (`kind` is IMPINGE_TRIANGLES and so on) and positions under the old number. What is kept is said in impinge.h.
  template <class F, class P> result<void> remesh(body of, std::uint32_t kind, const F &elements, const P &positions) {
    return detail::give(impinge_scene_remesh(raw(), of, kind, detail::rows_of(elements, kind), detail::rows_of(positions, 3)));
  }
  /// The caller's own numbers of the edges of a body.
  template <class E> result<void> set_edges(body of, const E &edges) { return detail::give(impinge_scene_set_edges(raw(), of, detail::rows_of(edges, 2))); }
  template <class P> result<void> set_positions(body of, const P &positions) {
    return detail::give(impinge_scene_set_positions(raw(), of, detail::rows_of(positions, 3)));
  }
  /// No rows are refused for a body that has vertices: `clear_end_positions` lets it stand still.
  template <class P> result<void> set_end_positions(body of, const P &positions) {
    const array at = detail::rows_of(positions, 3);
    if (const auto n = vertices_without_rows(of, at)) return refuse_no_rows(of, n);
    return detail::give(impinge_scene_set_end_positions(raw(), of, at));
  }
  /// The body stands still.
  result<void> clear_end_positions(body of) { return detail::give(impinge_scene_set_end_positions(raw(), of, array{nullptr, 0, 0, 0, IMPINGE_F64})); }
  /// Positions that the scene reads where they lie, and shares the owner of. Up to 32,768 are checked in
  /// this call, more by the next question; they must not change.
  template <class P> result<void> lend_positions(body of, std::shared_ptr<P> owner) { return lend(impinge_scene_lend_positions, of, std::move(owner)); }
  template <class P> result<void> lend_end_positions(body of, std::shared_ptr<P> owner) {
    if (!owner) return refuse_no_owner();
    if (const auto n = vertices_without_rows(of, detail::rows_of<std::remove_const_t<P>>(*owner, 3))) return refuse_no_rows(of, n);
    return lend(impinge_scene_lend_end_positions, of, std::move(owner));
  }
  /// Four rows of four numbers.
  template <class M> result<void> set_transform(body of, const M &matrix) { return detail::give(impinge_scene_set_transform(raw(), of, detail::rows_of(matrix, 4))); }
  /// The end of the step, in the same way.
  template <class M> result<void> set_end_transform(body of, const M &matrix) {
    return detail::give(impinge_scene_set_end_transform(raw(), of, detail::rows_of(matrix, 4)));
  }
  result<void> set_filter(body of, std::uint64_t category, std::uint64_t mask) { return detail::give(impinge_scene_set_filter(raw(), of, category, mask)); }
  /// The group of each vertex, for `query::exclude_groups`.
  template <class G> result<void> set_groups(body of, const G &groups) { return detail::give(impinge_scene_set_groups(raw(), of, detail::rows_of(groups, 1))); }
  /// Which vertices never move: 1 or 0 for each, as bytes or integers. Not for vertices that you move yourself: see impinge.h,
  /// also for what looks at them all the same.
  template <class G> result<void> set_pinned(body of, const G &pinned) { return detail::give(impinge_scene_set_pinned(raw(), of, detail::rows_of(pinned, 1))); }
  /// How thick all elements of a body are: see impinge.h. Steps keep it, too.
  result<void> set_thickness(body of, double thickness) { return detail::give(impinge_scene_set_thickness(raw(), of, thickness)); }
  /// One thickness per vertex, edge or face; other elements are as thick as the thickest of these that they have or are part of.
  template <class T> result<void> set_vertex_thickness(body of, const T &thickness) { return element_thickness(of, IMPINGE_POINTS, thickness); }
  template <class T> result<void> set_edge_thickness(body of, const T &thickness) { return element_thickness(of, IMPINGE_EDGES, thickness); }
  template <class T> result<void> set_face_thickness(body of, const T &thickness) { return element_thickness(of, IMPINGE_TRIANGLES, thickness); }

  /// 0 also while another call changes the scene, and of a broken one.
  std::size_t n_bodies() const noexcept { return impinge_scene_n_bodies(raw()); }
  /// Views. Positions live until the scene is changed; elements, edges and faces until the body is re-meshed or removed, or its edges are set.
  result<array> positions(body of) const & { return look(impinge_scene_positions, of); }
  result<array> end_positions(body of) const & { return look(impinge_scene_end_positions, of); }
  result<array> elements(body of) const & { return look(impinge_scene_elements, of); }
  result<array> edges(body of) const & { return look(impinge_scene_edges, of); }
  result<array> faces(body of) const & { return look(impinge_scene_faces, of); }

  impinge_scene *raw() noexcept { return handle_.get(); }
  const impinge_scene *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void positions(body) const && = delete;
  void end_positions(body) const && = delete;
  void elements(body) const && = delete;
  void edges(body) const && = delete;
  void faces(body) const && = delete;

private:
  /// How many vertices a body has, if no rows are given for them.
  std::size_t vertices_without_rows(body of, const array &at) const {
    array now{};
    return at.rows == 0 && impinge_scene_positions(raw(), of, &now) == IMPINGE_OK ? now.rows : 0;
  }
  static result<void> refuse_no_rows(body of, std::size_t n) {
    const std::string given = "body " + std::to_string(of) + ": 0 end positions given, but it has " + std::to_string(n);
    return detail::refuse((given + " vertices; clear_end_positions lets it stand still").c_str());
  }
  static result<void> refuse_no_owner() { return detail::refuse("owner is NULL"); }
  template <class Lend, class P> result<void> lend(Lend call, body of, std::shared_ptr<P> owner) {
    if (!owner) return refuse_no_owner();
    const array at = detail::rows_of<std::remove_const_t<P>>(*owner, 3);
    auto kept = std::make_unique<std::shared_ptr<P>>(std::move(owner));
    const auto status = call(raw(), of, at, [](void *user) { delete static_cast<std::shared_ptr<P> *>(user); }, kept.get());
    if (status == IMPINGE_OK) kept.release();
    return detail::give(status);
  }
  template <class T> result<void> element_thickness(body of, std::uint32_t kind, const T &thickness) {
    return detail::give(impinge_scene_set_element_thickness(raw(), of, kind, detail::rows_of(thickness, 1)));
  }
  template <class Look> result<array> look(Look call, body of) const & {
    array view{};
    return detail::give(call(raw(), of, &view), std::move(view));
  }
  detail::handle<impinge_scene, impinge_scene_destroy> handle_;
};

} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_SCENE_HPP
