// What a temporary answer does not give: views, which would outlive it. And which results have no test. Nothing here runs: it compiles, or it
// does not.
#include <impinge/impinge.hpp>
#ifdef WITH_EIGEN
#include <impinge/eigen.hpp>
#endif

namespace {

template <class T, class Call> constexpr bool compiles(Call) { return std::is_invocable_v<Call, T>; }
#define CALL(call) [](auto &&of) -> decltype(std::forward<decltype(of)>(of) call) { return std::forward<decltype(of)>(of) call; }

// A call that an answer with a name takes, and a temporary one does not.
#define OF_NAMED(type, call)                                                                                                          \
  static_assert(compiles<type &>(CALL(call)) && compiles<const type &>(CALL(call)), #type #call " of one with a name");               \
  static_assert(!compiles<type>(CALL(call)) && !compiles<const type>(CALL(call)), #type #call " of a temporary")
// A call whose result is a value of its own.
#define OF_ANY(type, call) static_assert(compiles<const type &>(CALL(call)) && compiles<type>(CALL(call)), #type #call)

using namespace impinge;
constexpr auto kind = pair_kind::ee;

#define ROWS(type)                                                                                                                    \
  OF_NAMED(type, .data());                                                                                                            \
  OF_NAMED(type, .begin());                                                                                                           \
  OF_NAMED(type, .end());                                                                                                             \
  OF_NAMED(type, .rows());                                                                                                            \
  OF_NAMED(type, .column(0));                                                                                                         \
  OF_NAMED(type, .stats());                                                                                                           \
  OF_ANY(type, .size());                                                                                                              \
  OF_ANY(type, .empty());                                                                                                             \
  OF_ANY(type, [0]);                                                                                                                  \
  static_assert(!std::is_reference_v<decltype(std::declval<type>()[0])>)
ROWS(pairs);
ROWS(impacts);
ROWS(candidates);
ROWS(near_pairs);
ROWS(contacts);
ROWS(penetration);
ROWS(closest);
ROWS(hits);

OF_ANY(pairs, .hash());
OF_ANY(pairs, .between(0, 1));
OF_ANY(pairs, .self_of(0));
OF_NAMED(changes, .kept());
OF_NAMED(changes, .added());
OF_NAMED(changes, .gone());
OF_ANY(changes, .empty());
OF_NAMED(impacts, .of(kind));
OF_NAMED(candidates, .kinds());
OF_NAMED(candidates, .of(kind));
OF_NAMED(near_pairs, .kinds());
OF_NAMED(near_pairs, .of(kind));
OF_NAMED(near_pairs, .features());
OF_NAMED(near_pairs, .distances());
OF_NAMED(near_pairs, .closest_points());
OF_ANY(near_pairs, .stencils(scene()));
OF_ANY(stencils, .merged());
OF_ANY(stencils, .size());
OF_NAMED(stencils, .vertices());
OF_NAMED(stencils, .starts());
OF_NAMED(stencils, .kinds());
OF_NAMED(stencils, .features());
OF_NAMED(stencils, .weights());
OF_NAMED(stencils, .coefficients());
OF_NAMED(stencils, .squared_distances());
OF_NAMED(stencils, .gradients());
OF_NAMED(stencils, .hessians());
OF_NAMED(stencils, .mollifiers());
OF_NAMED(stencils, .mollifier_gradients());
OF_NAMED(stencils, .mollifier_hessians());
OF_NAMED(contacts, .points());
OF_NAMED(contacts, .starts());
OF_NAMED(contacts, .corners());
OF_NAMED(contacts, .curve_starts());
OF_NAMED(contacts, .curve_points());
OF_NAMED(contacts, .curve_closed());
OF_NAMED(contacts, .curve_lengths());
OF_NAMED(penetration, .inside_a());
OF_NAMED(penetration, .inside_b());
OF_ANY(penetration, .volume());
OF_NAMED(closest, .of(0));
OF_NAMED(hits, .is_hit());
OF_NAMED(hits, .starts());
OF_NAMED(hits, .of(0));
OF_NAMED(safe_distances, .of(0));
OF_NAMED(safe_distances, .touching());
OF_NAMED(safe_distances, .stats());
OF_ANY(neighbours, .first(0));
OF_NAMED(neighbours, .of(kind));
OF_NAMED(neighbours, .reversed(kind));
OF_NAMED(neighbours, .vf());
OF_NAMED(neighbours, .fv());
OF_NAMED(neighbours, .ee());
OF_NAMED(neighbours, .stats());
OF_NAMED(truncation, .positions(0));
OF_ANY(truncation, .pairs());
OF_NAMED(impinge::advance, .positions(0));
OF_NAMED(impinge::advance, .stats());
OF_ANY(impinge::advance, .fraction());
OF_ANY(impinge::advance, .first());
OF_NAMED(scene, .positions(0));
OF_NAMED(scene, .end_positions(0));
OF_NAMED(scene, .elements(0));
OF_NAMED(scene, .edges(0));
OF_NAMED(scene, .faces(0));
OF_NAMED(detector, .stats());

// Setters of a temporary give a value, which a reference to it keeps, and those of one with a name that one.
#define SETTER(type, call)                                                                                                            \
  static_assert(std::is_same_v<decltype(std::declval<type>() call), type>, #type #call " of a temporary");                            \
  static_assert(std::is_same_v<decltype(std::declval<type &>() call), type &>, #type #call " of one with a name")
SETTER(query, .kinds({kind}));
SETTER(query, .shared_vertex(shared_vertex::skip));
SETTER(query, .exclude(0, 1));
SETTER(query, .exclude(std::declval<const near_pairs &>()));
SETTER(query, .exclude_rings(1));
SETTER(query, .exclude_groups(0, 1));
SETTER(query, .exclude_vertices(0, 1, std::declval<std::vector<int> &>(), std::declval<const std::vector<int> &>()));
SETTER(query, .fixed({0}));
SETTER(query, .n_nearest(2));
SETTER(query, .hits(hits_of_ray::all));
SETTER(query, .owned_by({0, 0, 0}, {1, 1, 1}));
SETTER(query, .start(start::skip));
SETTER(query, .precision(precision::f64));
SETTER(query, .separation(1));
SETTER(query, .clearance(1));
SETTER(query, .clearance(1, 0.5));
SETTER(query, .distances());
SETTER(query, .closest_points());
SETTER(query, .passes(nullptr, nullptr));
SETTER(settings, .backend(backend::cpu));
SETTER(settings, .method(method::cells));
SETTER(settings, .threads(1));
SETTER(settings, .memory_budget(1));
SETTER(settings, .max_pairs(1));
SETTER(settings, .reuse_margin(1));
SETTER(settings, .device("none"));
SETTER(settings, .cancelled(nullptr));
SETTER(settings, .progress(nullptr));
SETTER(settings, .log(nullptr));

#ifdef IMPINGE_NO_EXCEPTIONS
OF_NAMED(result<pairs>, .operator->());
static_assert(std::is_same_v<decltype(*std::declval<result<pairs>>()), pairs>, "a temporary gives its value away");
static_assert(std::is_same_v<decltype(*std::declval<result<pairs> &>()), pairs &>);
static_assert(std::is_same_v<decltype(std::declval<result<pairs>>().message()), std::string>);
// With exceptions `if (on.any(in))` and `if (on.count(in))` ask for the answer. Without them they would ask whether the call succeeded, so they
// do not compile.
template <class T> constexpr bool is_tested = std::is_constructible_v<bool, T>;
static_assert(!is_tested<decltype(std::declval<detector &>().any(scene()))> && !is_tested<const result<bool> &>);
static_assert(!is_tested<decltype(std::declval<detector &>().is_free(scene()))>);
static_assert(!is_tested<decltype(std::declval<detector &>().earliest(scene()))> && !is_tested<result<std::optional<nearest>>>);
static_assert(!is_tested<decltype(std::declval<detector &>().count(scene()))> && !is_tested<decltype(std::declval<detector &>().advance_fraction(scene()))>);
static_assert(!is_tested<const result<body> &> && !is_tested<result<std::int8_t>> && !is_tested<result<float>>);
static_assert(is_tested<result<pairs>> && is_tested<const result<array> &> && is_tested<result<std::vector<double>>> && is_tested<result<void>>);
static_assert(!std::is_convertible_v<result<pairs>, bool> && !std::is_convertible_v<result<bool>, bool> && !std::is_convertible_v<result<void>, bool>);
static_assert(std::is_same_v<decltype(std::declval<const result<bool> &>().ok()), bool> && noexcept(std::declval<const result<void> &>().ok()));
#endif

// What a query only looks at must outlive it.
template <class Near, class = void> struct excludes : std::false_type {};
template <class Near> struct excludes<Near, std::void_t<decltype(std::declval<query &>().exclude(std::declval<Near>()))>> : std::true_type {};
static_assert(excludes<near_pairs &>::value && excludes<const near_pairs &>::value && excludes<near_pairs>::value);
static_assert(detail::is_lost<std::vector<int>>::value && !detail::is_lost<std::vector<int> &>::value && !detail::is_lost<view<int>>::value);
#ifdef WITH_EIGEN
static_assert(detail::is_lost<Eigen::VectorXi>::value && !detail::is_lost<Eigen::Map<Eigen::VectorXi>>::value);
#endif

#ifdef WITH_EIGEN
#define MATRIX [](auto &&of) -> decltype(points_of(std::forward<decltype(of)>(of))) { return points_of(std::forward<decltype(of)>(of)); }
static_assert(compiles<const closest &>(MATRIX) && !compiles<closest>(MATRIX), "points_of");
#endif

// A loop keeps the answer that it goes through.
[[maybe_unused]] void loop(detector &on, const scene &in) {
#ifdef IMPINGE_NO_EXCEPTIONS
  for (const auto &row : *on.detect(in)) (void)row;
  for (const auto &at : (*on.detect(in)).between(0, 1)) (void)at;
#else
  for (const auto &row : on.detect(in)) (void)row;
  for (const auto &at : on.detect(in).between(0, 1)) (void)at;
#endif
}

} // namespace
