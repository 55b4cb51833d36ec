// Meshes as matrices of Eigen, of any order, without a copy: a mesh that is folded into itself, and what a block of a larger matrix meets.
#include <impinge/igl.hpp>

#include <iostream>

int main() {
  // Three triangles in a strip, the last of them bent back through the first.
  Eigen::MatrixXd V(5, 3); // column-major, as Eigen has it by default
  V << 0, 0, 0, /**/ 2, 0, 0, /**/ 0, 2, 0, /**/ 2, 2, 1, /**/ -1, -1, -1;
  Eigen::MatrixXi F(3, 3);
  F << 0, 1, 2, /**/ 1, 3, 2, /**/ 3, 4, 2;
  Eigen::MatrixXi IF;
  if (impinge::igl::self_intersections(V, F, IF)) std::cout << "faces that intersect:\n" << IF << "\n";

  // A solver's state: positions of all bodies in one matrix, row-major. Blocks of it are read where they lie.
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> state(10, 3);
  state << V, V.rowwise() + Eigen::RowVector3d(0.1, 0.1, 0.1);
  impinge::scene scene;
  const auto a = scene.add_triangles(F, state.topRows(5)), b = scene.add_triangles(F, state.bottomRows(5));
  impinge::detector detector(impinge::backend::cpu);
  const auto pairs = detector.detect(scene, impinge::query::between(a, b));
  std::cout << "pairs between both:\n" << impinge::as_matrix(pairs.rows()) << "\n";
  return pairs.empty() || IF.rows() == 0;
}
