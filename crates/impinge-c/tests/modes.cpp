// One program of two units, with and without exceptions: each has classes of its own.
#include "common.h"
#include <impinge/impinge.hpp>

#ifdef IMPINGE_NO_EXCEPTIONS
#define OK(call) CHECK((call).ok())
int without_exceptions();
int without_exceptions() {
#else
#define OK(call) (call)
int without_exceptions();
int main() {
#endif
  impinge::scene scene;
  OK(scene.add_triangles(std::vector<int>{0, 1, 2}, std::vector<double>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
  OK(scene.add_points(std::vector<double>{.25, .25, .5}));
  // More than one, so that what one constructor writes too far meets another.
  std::vector<std::unique_ptr<impinge::detector>> detectors;
  for (int ix = 0; ix < 4; ++ix) detectors.push_back(std::make_unique<impinge::detector>(impinge::settings(impinge::backend::cpu).threads(1)));
  for (auto &detector : detectors) {
#ifdef IMPINGE_NO_EXCEPTIONS
    const auto near = detector->near(scene, 0.5), refused = detector->near(scene, -1);
    CHECK(near && near->size() == 1 && !refused && refused.status() == IMPINGE_ERROR_INVALID);
    const auto any = detector->any(scene);
    CHECK(any.ok() && !*any);
    // What can be tested in both modes means the same in both, so results of numbers cannot.
    const auto n = detector->count(scene);
    CHECK(n.ok() && *n == 0);
  }
  return n_failed;
#else
    CHECK(detector->near(scene, 0.5).size() == 1 && !detector->any(scene) && !detector->count(scene));
    try {
      detector->near(scene, -1);
      CHECK(!"it has thrown");
    } catch (const impinge::error &error) {
      CHECK(error.status() == IMPINGE_ERROR_INVALID);
    }
  }
  n_failed += without_exceptions();
  return finish("units with and without exceptions");
#endif
}
