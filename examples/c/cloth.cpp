// A cloth of springs falls on a ball. Each step goes as far as nothing touches, so the cloth never passes through the ball or itself.
//
// cloth [FILE.obj]: with a file, what the cloth has come to is written to it.
#include <impinge/impinge.hpp>

#include <cmath>
#include <cstdio>

using vec = std::array<double, 3>;

static double dot(const vec &a, const vec &b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double norm(const vec &a) { return std::sqrt(dot(a, a)); }
static vec along(const vec &a, double t, const vec &b) { return {a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]}; }

/// A ball of radius 1: a cube whose faces are grids, blown up.
static void ball(std::vector<vec> &at, std::vector<std::array<int, 3>> &faces, int n) {
  for (int side = 0; side < 6; ++side) {
    const int first = static_cast<int>(at.size()), axis = side / 2;
    for (int i = 0; i <= n; ++i)
      for (int j = 0; j <= n; ++j) {
        vec p{};
        p[axis] = side % 2 ? 1 : -1;
        p[(axis + 1) % 3] = 2.0 * i / n - 1;
        p[(axis + 2) % 3] = 2.0 * j / n - 1;
        at.push_back(along({}, 1 / norm(p), p));
      }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const int a = first + i * (n + 1) + j, b = a + 1, c = a + n + 1, d = c + 1;
        faces.push_back({a, c, b});
        faces.push_back({b, c, d});
      }
  }
}

/// Ball and cloth as groups of an OBJ file.
static bool write(const char *path, const std::vector<vec> (&at)[2], const std::vector<std::array<int, 3>> (&faces)[2]) {
  std::FILE *file = std::fopen(path, "w");
  if (!file) return false;
  int first = 1;
  for (int body = 0; body < 2; ++body) {
    std::fprintf(file, "g %s\n", body == 0 ? "ball" : "cloth");
    for (const auto &p : at[body]) std::fprintf(file, "v %.9g %.9g %.9g\n", p[0], p[1], p[2]);
    for (const auto &f : faces[body]) std::fprintf(file, "f %d %d %d\n", first + f[0], first + f[1], first + f[2]);
    first += static_cast<int>(at[body].size());
  }
  return std::fclose(file) == 0;
}

int main(int argc, char **argv) {
  constexpr int n = 24, n_frames = 120;
  constexpr double side = 3.0 / n, h = 0.01, clearance = 1e-3, reach = 0.02;
  std::vector<vec> ball_at, x, v(n * n);
  std::vector<std::array<int, 3>> ball_faces, faces;
  std::vector<std::array<int, 2>> springs;
  ball(ball_at, ball_faces, 12);
  // The sides of the cube have vertices of their own along its edges, and would touch there for ever.
  const auto weld = impinge::weld(ball_at);
  for (auto &face : ball_faces)
    for (int &vertex : face) vertex = static_cast<int>(weld.map[vertex]);
  for (std::size_t i = 0; i < weld.firsts.size(); ++i) ball_at[i] = ball_at[weld.firsts[i]];
  ball_at.resize(weld.firsts.size());
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      x.push_back({(i - n / 2) * side + 0.01, (j - n / 2) * side + 0.02, 1.1});
      const int a = i * n + j;
      if (i + 1 < n) springs.push_back({a, a + n});
      if (j + 1 < n) springs.push_back({a, a + 1});
      if (i + 1 < n && j + 1 < n) {
        springs.push_back({a, a + n + 1});
        springs.push_back({a + 1, a + n});
        faces.push_back({a, a + n, a + 1});
        faces.push_back({a + 1, a + n, a + n + 1});
      }
    }
  const auto rest = x;

  impinge::scene scene;
  const auto ground = scene.add_triangles(ball_faces, ball_at);
  const auto cloth = scene.add_triangles(faces, x);
  impinge::detector detector(impinge::backend::cpu);
  const auto step = impinge::query::all().exclude(ground, ground).clearance(clearance);
  const auto close = impinge::query::all().exclude(ground, ground).kinds({impinge::pair_kind::vf, impinge::pair_kind::ee}).closest_points();
  // The edges of the cloth, as near pairs number them.
  const auto edges = static_cast<const std::array<std::uint32_t, 2> *>(scene.edges(cloth).data);

  int n_whole = 0;
  for (int frame = 0; frame < n_frames; ++frame) {
    for (auto &speed : v) speed[2] -= 9.81 * h;
    const auto near = detector.near(scene, reach, close);
    const auto vertices = [&](bool is_b, std::size_t i) -> std::vector<std::uint32_t> {
      const auto &row = near[i];
      const auto element = is_b ? row.element_b : row.element_a;
      if ((is_b ? row.body_b : row.body_a) != cloth) return {};
      if (near.kinds()[i] == IMPINGE_EE) return {edges[element][0], edges[element][1]};
      if (!is_b) return {element};
      return {static_cast<std::uint32_t>(faces[element][0]), static_cast<std::uint32_t>(faces[element][1]), static_cast<std::uint32_t>(faces[element][2])};
    };
    for (int round = 0; round < 10; ++round) {
      // Springs keep their length, and what is near does not come nearer.
      for (const auto &[a, b] : springs) {
        const vec apart = along(along(x[b], h, v[b]), -1, along(x[a], h, v[a])), was = along(rest[b], -1, rest[a]);
        const double length = norm(apart), error = length - norm(was);
        v[a] = along(v[a], 0.2 * error / (length * h), apart);
        v[b] = along(v[b], -0.2 * error / (length * h), apart);
      }
      for (std::size_t i = 0; i < near.size(); ++i) {
        const auto &[p, q] = near.closest_points()[i];
        const vec out = along(p, -1, q);
        const double distance = norm(out);
        const auto of_a = vertices(false, i), of_b = vertices(true, i);
        double speed = 0;
        for (const auto a : of_a) speed += dot(v[a], out) / (distance * static_cast<double>(of_a.size()));
        for (const auto b : of_b) speed -= dot(v[b], out) / (distance * static_cast<double>(of_b.size()));
        const double wished = 0.2 * (reach - distance) / h - speed, share = of_a.empty() || of_b.empty() ? 1 : 0.5;
        if (wished <= 0) continue;
        for (const auto a : of_a) v[a] = along(v[a], share * wished / distance, out);
        for (const auto b : of_b) v[b] = along(v[b], -share * wished / distance, out);
      }
    }
    auto wish = x;
    for (std::size_t i = 0; i < x.size(); ++i) wish[i] = along(x[i], h, v[i]);
    scene.set_end_positions(cloth, wish);
    const double fraction = detector.advance_fraction(scene, step);
    n_whole += fraction == 1;
    // With a clearance, the fraction holds for positions that are computed here.
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = along(x[i], fraction, along(wish[i], -1, x[i]));
      v[i] = along({}, fraction < 1 ? 0.5 : 0.99, v[i]);
    }
    scene.set_positions(cloth, x);
    if (detector.any(scene)) {
      std::printf("frame %d: the cloth intersects\n", frame);
      return 1;
    }
  }
  double lowest = x[0][2];
  for (const auto &at : x) lowest = std::min(lowest, at[2]);
  std::printf("%d frames, %d of them whole steps, none with an intersection: the cloth hangs down to %.2f, %.4f away from the ball\n", n_frames,
              n_whole, lowest, detector.distance(scene, ground, cloth)->distance);
  if (argc > 1 && !write(argv[1], {ball_at, x}, {ball_faces, faces})) {
    std::fprintf(stderr, "cloth: cannot write %s\n", argv[1]);
    return 1;
  }
  return n_whole < n_frames / 2;
}
