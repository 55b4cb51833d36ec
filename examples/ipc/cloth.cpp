// An implicit cloth that falls on a ball: ipc-toolkit's barrier, impinge's collision stage. The same as cloth.py, in C++.
//
//   cmake -S examples/ipc -B build -Dimpinge_ROOT=PREFIX      # fetches ipc-toolkit, and compiles it
//   cmake --build build && build/ipc_cloth 32 300             # vertices along an edge, frames
//
// Implicit Euler and Newton's method with a line search, as in Incremental Potential Contact (Li et al. 2020). Potential, gradient and
// Hessian of the barrier are ipc-toolkit's. Two lines make impinge its collision stage; both are marked.
#include <impinge/ipc.hpp>

#include <ipc/collisions/normal/normal_collisions.hpp>
#include <ipc/potentials/barrier_potential.hpp>

#include <Eigen/SparseCholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <set>
#include <tuple>
#include <vector>

namespace {

/// Distance at which the barrier begins, in metres, and its stiffness.
constexpr double dhat = 2e-3, barrier_stiffness = 1e6;
/// Length of a frame in seconds; of springs along edges, and across two of them, which resist bending.
constexpr double frame_time = 1.0 / 100, stretch = 60.0, bend = 0.5;
/// Newton's method ends where no vertex would move by more, in metres per second.
constexpr double tolerance = 1e-2;

struct shape {
  std::vector<Eigen::RowVector3d> points;
  std::vector<Eigen::RowVector3i> faces;
};

/// A square of n x n vertices, turned a little, so that nothing is symmetric.
shape square(int n, double height) {
  shape of;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double x = -0.5 + i / (n - 1.0), y = -0.5 + j / (n - 1.0);
      of.points.emplace_back(x + 0.13 * y, y - 0.11 * x, height);
      if (i + 1 == n || j + 1 == n) continue;
      const int corner = i * n + j;
      of.faces.emplace_back(corner, corner + n, corner + n + 1);
      of.faces.emplace_back(corner, corner + n + 1, corner + 1);
    }
  return of;
}

/// An octahedron whose faces are cut into four some times, on a sphere.
shape ball(double radius, int n_cuts) {
  shape of;
  for (const double sign : {1.0, -1.0})
    for (int axis = 0; axis < 3; ++axis) of.points.push_back(sign * Eigen::RowVector3d::Unit(axis));
  for (const auto &face : {std::array<int, 3>{0, 1, 2}, {1, 3, 2}, {3, 4, 2}, {4, 0, 2}, {1, 0, 5}, {3, 1, 5}, {4, 3, 5}, {0, 4, 5}})
    of.faces.emplace_back(face[0], face[1], face[2]);
  for (int cut = 0; cut < n_cuts; ++cut) {
    std::map<std::array<int, 2>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [at, is_new] = middles.try_emplace({std::min(a, b), std::max(a, b)}, static_cast<int>(of.points.size()));
      if (is_new) of.points.push_back((of.points[static_cast<std::size_t>(a)] + of.points[static_cast<std::size_t>(b)]) / 2);
      return at->second;
    };
    std::vector<Eigen::RowVector3i> faces;
    for (const auto &face : of.faces) {
      const int a = face[0], b = face[1], c = face[2], ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      faces.insert(faces.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    of.faces = std::move(faces);
  }
  for (auto &point : of.points) point = radius * point.normalized();
  return of;
}

struct spring {
  int i, j;
  double stiffness, length;
};

[[noreturn]] void fail(const char *text) {
  std::fprintf(stderr, "%s\n", text);
  std::exit(1);
}

/// A cloth of springs above a ball that stands still.
class cloth {
public:
  explicit cloth(int side) : n_(side * side), mass_(0.2 / n_), velocities_(Eigen::MatrixXd::Zero(n_, 3)), barrier_(dhat, barrier_stiffness) {
    const shape sheet = square(side, 0.31), obstacle = ball(0.3, 3);
    positions_.resize(n_ + static_cast<Eigen::Index>(obstacle.points.size()), 3);
    Eigen::MatrixXi faces(static_cast<Eigen::Index>(sheet.faces.size() + obstacle.faces.size()), 3);
    Eigen::Index row = 0, face_row = 0;
    for (const auto *of : {&sheet, &obstacle}) {
      const auto first = static_cast<int>(row);
      for (const auto &point : of->points) positions_.row(row++) = point;
      for (const auto &face : of->faces) faces.row(face_row++) = (face.array() + first).matrix();
    }
    std::set<std::array<int, 2>> sides;
    for (Eigen::Index f = 0; f < faces.rows(); ++f)
      for (int k = 0; k < 3; ++k) {
        const auto [a, b] = std::minmax({faces(f, k), faces(f, (k + 1) % 3)});
        sides.insert({a, b});
      }
    Eigen::MatrixXi edges(static_cast<Eigen::Index>(sides.size()), 2);
    row = 0;
    for (const auto &[a, b] : sides) {
      edges.row(row++) << a, b;
      if (b < n_) add_spring(a, b, stretch);
    }
    for (int i = 0; i < side; ++i)
      for (int j = 0; j < side; ++j) {
        if (i + 2 < side) add_spring((i + 2) * side + j, i * side + j, bend);
        if (j + 2 < side) add_spring(i * side + j + 2, i * side + j, bend);
      }
    mesh_ = std::make_unique<ipc::CollisionMesh>(positions_, edges, faces);
    mesh_->can_collide = ipc::make_static_obstacle_filter(static_cast<std::size_t>(n_));
  }

  void frame() {
    const Eigen::MatrixXd start = positions_.topRows(n_);
    Eigen::MatrixXd goal = start + frame_time * velocities_;
    goal.col(2).array() -= 9.81 * frame_time * frame_time;
    for (int iteration = 0;; ++iteration) {
      if (iteration == 300) fail("Newton's method does not converge");
      Eigen::VectorXd gradient;
      Eigen::SparseMatrix<double> hessian;
      derivatives(goal, gradient, hessian);
      const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(hessian);
      const Eigen::VectorXd way = solver.solve(-gradient);
      if (way.cwiseAbs().maxCoeff() < tolerance * frame_time) break;
      ++n_iterations;
      Eigen::MatrixXd dx = Eigen::MatrixXd::Zero(positions_.rows(), 3);
      dx.topRows(n_) = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(way.data(), n_, 3);
      // ---- impinge: how far the step is free
      double step = impinge::ipc::compute_collision_free_stepsize(*mesh_, positions_, positions_ + dx);
      // ----
      const double before = energy(positions_, goal), slope = gradient.dot(way);
      while (energy(positions_ + step * dx, goal) > before + 1e-4 * step * slope && step > 1e-12) step /= 2;
      positions_ += step * dx;
      // Asked apart from the simulation: it must never be needed.
      if (impinge::ipc::has_intersections(*mesh_, positions_)) fail("the cloth intersects");
    }
    velocities_ = (positions_.topRows(n_) - start) / frame_time;
  }

  Eigen::Index n_vertices() const { return positions_.rows(); }
  std::size_t n_iterations = 0, most_collisions = 0;

private:
  void add_spring(int i, int j, double stiffness) { springs_.push_back({i, j, stiffness, (positions_.row(i) - positions_.row(j)).norm()}); }

  ipc::NormalCollisions collisions(const Eigen::MatrixXd &x) {
    ipc::NormalCollisions found;
    // ---- impinge: which pairs are near
    found.build(*mesh_, x, dhat, 0, &broad_phase_);
    // ----
    most_collisions = std::max(most_collisions, found.size());
    return found;
  }

  double energy(const Eigen::MatrixXd &x, const Eigen::MatrixXd &goal) {
    double sum = 0.5 * mass_ / (frame_time * frame_time) * (x.topRows(n_) - goal).squaredNorm();
    for (const auto &of : springs_) {
      const double longer = (x.row(of.i) - x.row(of.j)).norm() - of.length;
      sum += 0.5 * of.stiffness * longer * longer;
    }
    return sum + barrier_(collisions(x), *mesh_, x);
  }

  /// Gradient and Hessian for the vertices that move.
  void derivatives(const Eigen::MatrixXd &goal, Eigen::VectorXd &gradient, Eigen::SparseMatrix<double> &hessian) {
    const auto &x = positions_;
    const auto found = collisions(x);
    const Eigen::Index moving = 3 * n_;
    const double inertia = mass_ / (frame_time * frame_time);
    gradient = barrier_.gradient(found, *mesh_, x).head(moving);
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index v = 0; v < n_; ++v)
      for (int axis = 0; axis < 3; ++axis) {
        gradient[3 * v + axis] += inertia * (x(v, axis) - goal(v, axis));
        entries.emplace_back(3 * v + axis, 3 * v + axis, inertia);
      }
    for (const auto &of : springs_) {
      const Eigen::Vector3d d = (x.row(of.i) - x.row(of.j)).transpose();
      const double length = d.norm();
      const Eigen::Vector3d along = d / length, pull = of.stiffness * (length - of.length) * along;
      gradient.segment<3>(3 * of.i) += pull;
      gradient.segment<3>(3 * of.j) -= pull;
      // Without the part of compressed springs that is not convex.
      const Eigen::Matrix3d outer = along * along.transpose();
      const Eigen::Matrix3d block = of.stiffness * (outer + std::max(1 - of.length / length, 0.0) * (Eigen::Matrix3d::Identity() - outer));
      for (const auto &[a, b, sign] : {std::tuple(of.i, of.i, 1), std::tuple(of.j, of.j, 1), std::tuple(of.i, of.j, -1), std::tuple(of.j, of.i, -1)})
        for (int row = 0; row < 3; ++row)
          for (int column = 0; column < 3; ++column) entries.emplace_back(3 * a + row, 3 * b + column, sign * block(row, column));
    }
    hessian.resize(moving, moving);
    hessian.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SparseMatrix<double> of_barrier = barrier_.hessian(found, *mesh_, x, ipc::PSDProjectionMethod::CLAMP);
    hessian += Eigen::SparseMatrix<double>(of_barrier.topLeftCorner(moving, moving));
  }

  Eigen::Index n_;
  double mass_;
  Eigen::MatrixXd positions_, velocities_;
  std::vector<spring> springs_;
  std::unique_ptr<ipc::CollisionMesh> mesh_;
  ipc::BarrierPotential barrier_;
  impinge::ipc::BroadPhase broad_phase_;
};

} // namespace

int main(int n_arguments, char **arguments) {
  const int side = n_arguments > 1 ? std::atoi(arguments[1]) : 32, n_frames = n_arguments > 2 ? std::atoi(arguments[2]) : 300;
  if (side < 3 || n_frames < 1) fail("ipc_cloth [vertices along an edge] [frames]");
  cloth of(side);
  for (int frame = 0; frame < n_frames; ++frame) of.frame();
  std::printf("%d frames, %td vertices, %zu iterations, at most %zu collisions, no intersection\n", n_frames, of.n_vertices(), of.n_iterations,
              of.most_collisions);
}
