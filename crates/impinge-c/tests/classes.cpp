// The classes of impinge.hpp: what they own, what they throw, and that their answers are those of C. With -DIMPINGE_NO_EXCEPTIONS: results.
#include "common.h"
#include <impinge/impinge.hpp>
#if __cplusplus >= 202002L
#include <span>
#endif

namespace {

ball balls[2];
std::vector<std::array<std::uint32_t, 3>> faces(const ball &of) {
  std::vector<std::array<std::uint32_t, 3>> rows(FACES);
  memcpy(rows.data(), of.faces, sizeof of.faces);
  return rows;
}
std::vector<double> numbers(const ball &of) { return {&of.positions[0][0], &of.positions[0][0] + 3 * VERTICES}; }

#ifndef IMPINGE_NO_EXCEPTIONS
using impinge::pair_kind;
using impinge::query;

template <class Call> void throws(impinge_status status, const char *text, Call call) {
  try {
    call();
    CHECK(!"it has thrown");
  } catch (const impinge::error &error) {
    CHECK(error.status() == status);
    CHECK(strstr(error.what(), text) != nullptr);
  }
}

void answers() {
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  const auto b = scene.add_triangles(impinge::rows(&balls[1].faces[0][0], FACES), impinge::rows(&balls[1].positions[0][0], VERTICES));
  impinge::detector detector(impinge::backend::cpu);
  impinge::pairs kept;
  {
    auto pairs = detector.detect(scene);
    CHECK(pairs.size() > 100 && pairs.hash() == hash_of(detector.raw(), scene.raw(), nullptr));
    CHECK(pairs.between(a, b).size() == pairs.size() && pairs.self_of(a).empty());
    CHECK(pairs.between(b, a)[0][0] == pairs[0].element_b);
    CHECK(pairs.stats().n_candidates >= pairs.size());
    std::size_t n = 0;
    for (const auto &row : pairs) n += row.body_a == a;
    CHECK(n == pairs.size());
    kept = std::move(pairs);
  }
  CHECK(detector.count(scene, query::between(a, b)) == kept.size() && detector.any(scene));
  CHECK(!detector.any(scene, query::all().exclude(a, b)) && !detector.any(scene, query::self_all()));
#if __cplusplus >= 202002L
  std::span<const impinge::pair> span = kept.rows();
  CHECK(span.size() == kept.size());
#endif
  const auto contacts = detector.contacts(scene, kept);
  CHECK(contacts.size() == kept.size() && contacts.starts().size() == kept.size() + 1 && contacts.curve_starts().size() == 2);
  CHECK(contacts.curve_lengths()[0] > 5 && contacts.points().size() > 100);
  const auto deep = detector.penetration(scene, contacts, a, b);
  CHECK(deep.size() == 1 && deep.inside_a().size() == deep[0].n_inside[0] && deep.begin()->body_b == b);

  const auto near = detector.near(scene, 0.01, query::between_all().closest_points());
  CHECK(near.size() > 100 && near.distances().size() == near.size() && near.closest_points().size() == near.size());
  CHECK(near.of(pair_kind::vf).size() + near.of(pair_kind::ee).size() + near.of(pair_kind::ef).size() == near.size());
  CHECK(near.of(pair_kind::ff).empty() && near.features().size() == near.size());
  const auto candidates = detector.candidates(scene, 0.01, query::all().kinds({pair_kind::ee}));
  CHECK(candidates.of(pair_kind::ee).size() == candidates.size() && candidates.size() > 100);
  std::size_t n = 0;
  const auto given = detector.candidates_in_runs(
      scene, 0.01, 1000, [&](pair_kind, impinge::view<impinge::pair> rows) { n += rows.size(); return true; }, query::all().kinds({pair_kind::ee}));
  CHECK(given == n && n == candidates.size());
  throws(IMPINGE_ERROR_INVALID, "kinds", [&] { detector.detect(scene, query::all().kinds({pair_kind::ee})); });
  try {
    detector.candidates_in_runs(scene, 0.01, 10, [](pair_kind, impinge::view<impinge::pair>) -> bool { throw 7; });
    CHECK(!"it has thrown");
  } catch (int seven) {
    CHECK(seven == 7);
  }
}

void steps() {
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  auto far_away = std::make_shared<std::vector<double>>(numbers(balls[0]));
  for (std::size_t ix = 0; ix < far_away->size(); ix += 3) (*far_away)[ix] += 5;
  const auto b = scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  scene.lend_positions(b, far_away);
  CHECK(far_away.use_count() == 2 && scene.positions(b).data == far_away->data());
  scene.set_end_positions(b, numbers(balls[1]));
  impinge::detector detector(impinge::settings(impinge::backend::cpu).threads(1));
  const auto with = query::all().clearance(1e-3).start(impinge::start::verify).precision(impinge::precision::f64);
  const auto first = detector.earliest(scene, with);
  CHECK(first && first->body_b == b && !detector.is_free(scene, with) && detector.start_intersects() == false);
  const auto impacts = detector.impacts(scene, with);
  CHECK(impacts.of(pair_kind::vf).size() + impacts.of(pair_kind::ee).size() == impacts.size() && !impacts.empty());
  const auto advance = detector.advance(scene, with);
  CHECK(advance.fraction() > 0.5 && advance.fraction() == detector.advance_fraction(scene, with) && advance.first()->toi >= advance.fraction());
  CHECK(advance.positions(a).rows == 0 && advance.positions(b).rows == VERTICES && advance.start_intersects() == false);
  advance.apply(scene);
  CHECK(far_away.use_count() == 1);
  const auto nearest = detector.distance(scene, a, b);
  CHECK(nearest && nearest->distance >= 1e-3 && nearest->distance < 1.01e-3);
  throws(IMPINGE_ERROR_INVALID, "no body 9", [&] { scene.set_positions(9, numbers(balls[0])); });
  throws(IMPINGE_ERROR_INVALID, "row_stride", [&] { scene.set_positions(a, std::vector<double>(3 * VERTICES + 1)); });
  throws(IMPINGE_ERROR_INVALID, "row_stride", [&] { scene.set_positions(a, std::vector<std::array<float, 4>>(VERTICES)); });
}

void callbacks() {
  impinge::scene scene;
  scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  int n_logged = 0;
  bool stop = false;
  impinge::detector detector(impinge::settings(impinge::backend::cpu).log([&](std::uint32_t level, const char *) { n_logged += level == IMPINGE_LOG_ERROR; }).cancelled([&] {
    if (stop) throw std::runtime_error("from a callback");
    return true;
  }));
  impinge::detector moved = std::move(detector);
  throws(IMPINGE_ERROR_CANCELLED, "cancelled", [&] { moved.detect(scene); });
  CHECK(n_logged == 1);
  stop = true;
  try {
    moved.detect(scene);
    CHECK(!"it has thrown");
  } catch (const std::runtime_error &error) {
    CHECK(strcmp(error.what(), "from a callback") == 0);
  }
  throws(IMPINGE_ERROR_DEVICE, "gpu", [] { impinge::detector none(impinge::backend::gpu); });
  const std::vector<std::array<float, 3>> seam = {{0, 0, 0}, {1, 0, 0}, {0, 0, 0}};
  const auto weld = impinge::weld(seam);
  CHECK(weld.map == (std::vector<std::uint32_t>{0, 1, 0}) && weld.firsts == (std::vector<std::uint32_t>{0, 1}));
}
#endif

} // namespace

int main() {
  make_ball(&balls[0], 0);
  make_ball(&balls[1], 0.9);
#ifdef IMPINGE_NO_EXCEPTIONS
  impinge::scene scene;
  const auto a = scene.add_triangles(faces(balls[0]), numbers(balls[0]));
  const auto b = scene.add_triangles(faces(balls[1]), numbers(balls[1]));
  CHECK(a && b && *a == 0 && *b == 1);
  const auto none = scene.set_positions(9, numbers(balls[0]));
  CHECK(!none && none.status() == IMPINGE_ERROR_INVALID && none.message().find("no body 9") != std::string::npos);
  impinge::detector detector(impinge::backend::cpu);
  const auto pairs = detector.detect(scene);
  CHECK(pairs && pairs->size() > 100);
  const auto gpu = impinge::detector(impinge::backend::gpu).any(scene);
  CHECK(!gpu && gpu.status() == IMPINGE_ERROR_INVALID);
  return finish("classes without exceptions");
#else
  answers();
  steps();
  callbacks();
  return finish("classes");
#endif
}
