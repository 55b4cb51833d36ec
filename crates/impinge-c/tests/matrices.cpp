// Matrices of Eigen in any layout give the same pairs, and are not copied on the way. Linked with --wrap=malloc, so that copies are seen.
#include "common.h"
#include <impinge/igl.hpp>

extern "C" {
void *__real_malloc(size_t size);
static size_t largest = 0;
void *__wrap_malloc(size_t size) {
  if (size > largest) largest = size;
  return __real_malloc(size);
}
}

using by_row = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using faces_by_row = Eigen::Matrix<std::int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

// A function of a solver: whatever it is given, a reference.
static std::uint64_t hash_at(impinge::detector &detector, impinge::scene &scene, impinge::body of, Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>> positions) {
  scene.set_positions(of, positions);
  return detector.detect(scene).hash();
}

int main() {
  static ball balls[2];
  make_ball(&balls[0], 0);
  make_ball(&balls[1], 0.9);
  const Eigen::Map<const by_row> first(&balls[0].positions[0][0], VERTICES, 3), second(&balls[1].positions[0][0], VERTICES, 3);
  const faces_by_row faces = Eigen::Map<const Eigen::Matrix<std::uint32_t, Eigen::Dynamic, 3, Eigen::RowMajor>>(&balls[0].faces[0][0], FACES, 3).cast<std::int32_t>();
  const Eigen::MatrixXi by_column = faces;
  impinge::scene scene;
  impinge::detector detector(impinge::settings(impinge::backend::cpu).threads(1));
  scene.add_triangles(faces, first);
  const auto body = scene.add_triangles(by_column, second);
  const auto hash = detector.detect(scene).hash();
  CHECK(hash != 0);
  // Column-major, and blocks of larger matrices of either order.
  const Eigen::MatrixXd columns = second;
  Eigen::MatrixXd wide = Eigen::MatrixXd::Random(VERTICES + 5, 7);
  wide.block(2, 3, VERTICES, 3) = second;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> wide_rows = wide;
  Eigen::Matrix<float, 3, Eigen::Dynamic> turned = second.transpose().cast<float>();
  CHECK(hash_at(detector, scene, body, columns) == hash);
  CHECK(hash_at(detector, scene, body, wide.block(2, 3, VERTICES, 3)) == hash);
  scene.set_positions(body, wide_rows.block(2, 3, VERTICES, 3));
  CHECK(detector.detect(scene).hash() == hash);
  scene.set_positions(body, wide.middleCols(3, 3).middleRows(2, VERTICES));
  CHECK(detector.detect(scene).hash() == hash);
  // Vectors of a fixed size in a container, which are rows in memory, too.
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Array3i> corners;
  for (Eigen::Index v = 0; v < second.rows(); ++v) points.push_back(second.row(v));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) corners.push_back(faces.row(f));
  largest = 0;
  scene.set_positions(body, points);
  CHECK(largest < 1000 && detector.detect(scene).hash() == hash);
  const std::vector<Eigen::RowVector3f> narrow(points.size(), Eigen::RowVector3f::Zero());
  scene.set_positions(body, narrow);
  CHECK(scene.positions(body).type == IMPINGE_F32);
  const auto held = impinge::as_rows<Eigen::RowVector3f>(scene.positions(body));
  CHECK(held.size() == points.size() && held[1] == narrow[1]);
  scene.remesh(body, IMPINGE_TRIANGLES, corners, points);
  CHECK(detector.detect(scene).hash() == hash);
  try {
    scene.set_positions(body, std::vector<Eigen::Vector4d>(VERTICES, Eigen::Vector4d::Zero()));
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(std::strstr(error.what(), "rows of 4 numbers given, 3 needed") != nullptr);
  }
  // Packed rows go straight into the scene: no allocation at all is as large as the positions.
  largest = 0;
  scene.set_positions(body, second);
  CHECK(largest < 1000);
  // Other layouts are gathered once, into memory of the library, and never by Eigen.
  largest = 0;
  (void)impinge::detail::rows_of(wide.block(2, 3, VERTICES, 3), 3);
  CHECK(largest == 0);
  scene.set_positions(body, turned.transpose());
  CHECK(scene.positions(body).type == IMPINGE_F32 && scene.positions(body).rows == VERTICES);
  scene.set_positions(body, columns);
  CHECK(impinge::to_matrix(scene.positions(body)) == columns);
  const auto pairs = detector.detect(scene);
  const auto rows = impinge::as_matrix(pairs.rows());
  CHECK(rows.rows() == static_cast<Eigen::Index>(pairs.size()) && rows(0, 2) == pairs[0].body_b);
  try {
    scene.set_positions(body, wide);
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(error.status() == IMPINGE_ERROR_INVALID);
    CHECK(std::strstr(error.what(), "rows of 7 numbers given, 3 needed") != nullptr);
  }
  try {
    scene.set_positions(body, columns.transpose().eval());
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(std::strstr(error.what(), "needed, one row per position or element: transpose the matrix") != nullptr);
  }
  // Flags are one column, also of bytes, which any stride fits.
  using bytes = Eigen::Matrix<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic>;
  scene.set_pinned(body, bytes::Zero(VERTICES, 1).eval());
  try {
    scene.set_pinned(body, bytes::Zero(VERTICES, 2).eval());
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(error.status() == IMPINGE_ERROR_INVALID && std::strstr(error.what(), "pinned") != nullptr);
  }
  // Views of the library, each as what it is.
  const auto triangles = impinge::as_indices(scene.faces(body));
  CHECK(triangles.cols() == 3 && triangles(0, 1) == static_cast<const std::uint32_t *>(scene.faces(body).data)[1]);
  const auto edges = impinge::as_indices(scene.edges(body));
  CHECK(edges.cols() == 2 && edges(1, 0) == static_cast<const std::uint32_t *>(scene.edges(body).data)[2]);
  const auto safe = detector.safe_distances(scene, 1.0);
  const auto bounds = impinge::to_vector(safe.of(body));
  CHECK(bounds.size() == static_cast<Eigen::Index>(safe.of(body).rows) && bounds.minCoeff() >= 0 && bounds.maxCoeff() <= 1);
  for (const auto &other : {scene.faces(body), scene.edges(body), safe.of(body)}) {
    try {
      (void)impinge::to_matrix(other);
      CHECK(!"it has thrown");
    } catch (const impinge::error &error) {
      CHECK(error.status() == IMPINGE_ERROR_INVALID);
    }
  }
  // Points of any layout, and what is nearest to them, without a copy.
  const Eigen::MatrixXf probes = Eigen::MatrixXf::Random(20, 5);
  const auto closest = detector.closest(scene, probes.middleCols(1, 3));
  const auto nearest_points = impinge::points_of(closest);
  CHECK(nearest_points.rows() == 20);
  for (Eigen::Index ix = 0; ix < 20; ++ix) {
    const double length = (nearest_points.row(ix) - probes.row(ix).segment(1, 3).cast<double>()).norm();
    CHECK(std::abs(length - closest[static_cast<std::size_t>(ix)].distance) < 1e-12);
  }
  const auto lists = detector.neighbours(scene, 0.01);
  const auto offsets = impinge::as_vector(lists.vf().offsets);
  CHECK(offsets.size() == 2 * VERTICES + 1 && offsets(2 * VERTICES) == lists.vf().indices.size());
  // As libigl asks.
  Eigen::MatrixXi found;
  CHECK(impinge::igl::intersect_other(first, faces, columns, by_column, found));
  CHECK(found.rows() == static_cast<Eigen::Index>(pairs.size()) && found(0, 1) == static_cast<int>(pairs[0].element_b));
  CHECK(!impinge::igl::self_intersections(first, faces, found) && found.rows() == 0);
  by_row folded = first;
  folded.row(0) *= -1;
  CHECK(impinge::igl::self_intersections(folded, faces, found) && found(0, 0) < found(0, 1));
  return finish("matrices");
}
