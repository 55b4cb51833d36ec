// A cloth falls on a ball that breathes: in each frame which elements intersect and how near the two are, then the step to the next
// frame as far as it is free. The first argument is the folder with the meshes.
#include <impinge/impinge.hpp>

#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

using rows = std::vector<std::array<double, 3>>;

struct mesh {
  rows positions;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

static mesh read(const std::string &path) {
  mesh read;
  std::ifstream file(path);
  std::string kind;
  while (file >> kind) {
    if (kind == "v") {
      auto &at = read.positions.emplace_back();
      file >> at[0] >> at[1] >> at[2];
    } else {
      auto &face = read.faces.emplace_back();
      file >> face[0] >> face[1] >> face[2];
      for (auto &vertex : face) --vertex;
    }
  }
  return read;
}

static rows now(const impinge::scene &scene, impinge::body body) {
  const auto view = scene.positions(body);
  const auto first = static_cast<const std::array<double, 3> *>(view.data);
  return {first, first + view.rows};
}

int main(int n, char **arguments) {
  const std::string folder = n > 1 ? arguments[1] : ".";
  const auto cloth_mesh = read(folder + "/cloth.obj"), ball_mesh = read(folder + "/ball.obj");
  impinge::scene scene;
  const auto cloth = scene.add_triangles(cloth_mesh.faces, cloth_mesh.positions);
  const auto ball = scene.add_triangles(ball_mesh.faces, ball_mesh.positions);
  impinge::detector detector(impinge::backend::cpu);
  const auto query = impinge::query::all().clearance(1e-4);
  const double sizes[] = {1.0, 1.015625, 1.03125, 1.015625};
  for (int frame = 0; frame < 10; ++frame) {
    const auto pairs = detector.detect(scene, query);
    std::size_t between = 0, within = 0;
    for (const auto &pair : pairs) {
      between += pair.body_a != pair.body_b;
      within += pair.body_a == cloth && pair.body_b == cloth;
    }
    const auto nearest = detector.distance(scene, cloth, ball);
    std::printf("%d: %zu pairs, %zu in the cloth, %.9f apart\n", frame, between, within, nearest->distance);
    auto falls = now(scene, cloth);
    for (auto &at : falls) at[2] -= 0.03125;
    auto breathes = ball_mesh.positions;
    for (auto &at : breathes)
      for (auto &x : at) x *= sizes[frame % 4];
    scene.set_end_positions(cloth, falls);
    scene.set_end_positions(ball, breathes);
    detector.advance(scene, query).apply(scene);
  }
}
