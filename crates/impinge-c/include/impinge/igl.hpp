/// impinge/igl.hpp: questions in the shape of libigl's, which need Eigen alone.
#ifndef IMPINGE_IGL_HPP
#define IMPINGE_IGL_HPP

#include <impinge/eigen.hpp>

#ifdef IMPINGE_NO_EXCEPTIONS
#error "impinge/igl.hpp needs exceptions: its functions return answers"
#endif

namespace impinge {
inline namespace IMPINGE_MODE {
namespace igl {

namespace detail {
/// Element numbers of both sides as n x 2 integers.
inline Eigen::MatrixXi elements(const pairs &found) {
  Eigen::MatrixXi rows(static_cast<Eigen::Index>(found.size()), 2);
  Eigen::Index ix = 0;
  for (const auto &row : found) {
    rows(ix, 0) = static_cast<int>(row.element_a);
    rows(ix, 1) = static_cast<int>(row.element_b);
    ++ix;
  }
  return rows;
}
} // namespace detail

/// The pairs of faces of one mesh that intersect, as `igl::copyleft::cgal::remesh_self_intersections` finds them with `detect_only`, sorted.
///
/// V is #V x 3 (float or double), F #F x 3. IF gets #IF x 2 face numbers, the lower one first. Faces that share a vertex or an edge
/// count where they meet in more than that. Decided exactly; touching counts. Returns whether there are any.
template <class DerivedV, class DerivedF>
bool self_intersections(const Eigen::MatrixBase<DerivedV> &V, const Eigen::MatrixBase<DerivedF> &F, Eigen::MatrixXi &IF) {
  scene of;
  const body mesh = of.add_triangles(F.derived(), V.derived());
  detector on(backend::cpu);
  IF = detail::elements(on.detect(of, query::self_of(mesh)));
  return IF.rows() > 0;
}

/// The pairs of faces of two meshes that intersect, as `igl::copyleft::cgal::intersect_other` finds them with `detect_only`, sorted: IF gets
/// a face of the first and one of the second.
template <class DerivedVA, class DerivedFA, class DerivedVB, class DerivedFB>
bool intersect_other(const Eigen::MatrixBase<DerivedVA> &VA, const Eigen::MatrixBase<DerivedFA> &FA, const Eigen::MatrixBase<DerivedVB> &VB,
                     const Eigen::MatrixBase<DerivedFB> &FB, Eigen::MatrixXi &IF) {
  scene of;
  const body a = of.add_triangles(FA.derived(), VA.derived());
  const body b = of.add_triangles(FB.derived(), VB.derived());
  detector on(backend::cpu);
  IF = detail::elements(on.detect(of, query::between(a, b)));
  return IF.rows() > 0;
}

} // namespace igl
} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_IGL_HPP
