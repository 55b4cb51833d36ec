// What callbacks throw passes through the library, however the program is linked; and so does what panics within it.
#include "common.h"
#include <impinge/impinge.hpp>
#include <stdexcept>

extern "C" impinge_status impinge_test_panic(impinge_detector *detector);

template <class Call> static void throws(const char *text, Call call) {
  try {
    call();
    CHECK(!"it has thrown");
  } catch (const std::logic_error &error) {
    CHECK(strcmp(error.what(), text) == 0);
  }
}

int main() {
  static ball balls[2];
  impinge::scene scene;
  for (int ix = 0; ix < 2; ++ix) {
    make_ball(&balls[ix], 0.9 * ix);
    scene.add_triangles(impinge::rows(&balls[ix].faces[0][0], FACES), impinge::rows(&balls[ix].positions[0][0], VERTICES));
  }
  bool stops = true;
  impinge::detector detector(impinge::settings(impinge::backend::cpu).threads(2).cancelled([&]() -> bool {
    if (stops) throw std::logic_error("cancelled");
    return false;
  }));
  throws("cancelled", [&] { detector.detect(scene); });
  stops = false;
  CHECK(detector.detect(scene).size() > 100);
  throws("run", [&] { detector.candidates_in_runs(scene, 0.01, 10, [](impinge::pair_kind, impinge::view<impinge::pair>) -> bool { throw std::logic_error("run"); }); });
  CHECK(impinge_test_panic(detector.raw()) == IMPINGE_ERROR_INTERNAL);
  CHECK(strstr(impinge_error_message(), "as a test asked") != nullptr);
  return finish("callbacks");
}
