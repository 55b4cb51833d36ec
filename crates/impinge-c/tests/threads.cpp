// Two threads ask one detector of impinge.hpp. Calls are held up on their way out of the library, where the order of two threads matters.
// The detector has no threads of its own: sanitizers do not see how the library makes them wait.
#include "common.h"
#include <atomic>
#include <thread>

namespace {

enum turn { nothing, is_called, is_refused, is_out, is_done };
std::atomic<int> turn{nothing};
thread_local bool is_first = false;

void await(int of) {
  while (turn < of) std::this_thread::yield();
}

impinge_status any_in_turn(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query, int32_t *any) {
  const auto status = impinge_any(detector, scene, query, any);
  if (is_first) {
    turn = is_out;
    await(is_done);
  } else if (turn == is_called) {
    turn = is_refused;
    await(is_out);
  }
  return status;
}

} // namespace

#define impinge_any any_in_turn
#include <impinge/impinge.hpp>

namespace {

// The first thread's callback throws when the second thread has been refused. Before either takes what is its own, both have left the library;
// and before the first does, the second asks again.
void each_has_its_own_exception() {
  static ball one;
  make_ball(&one, 0);
  impinge::scene scene;
  for (int n = 0; n < 2; ++n) scene.add_triangles(impinge::rows(&one.faces[0][0], FACES), impinge::rows(&one.positions[0][0], VERTICES));
  int n_calls = 0;
  impinge::detector detector(impinge::settings(impinge::backend::cpu).threads(1).cancelled([&]() -> bool {
    ++n_calls;
    if (!is_first) return false;
    turn = is_called;
    await(is_refused);
    throw std::runtime_error("of the first");
  }));
  std::thread second([&] {
    await(is_called);
    const auto stats = detector.stats();
    CHECK(std::string(stats.backend).empty() && std::string(stats.method).empty() && stats.n_threads == 0);
    try {
      detector.any(scene);
      CHECK(!"it is refused");
    } catch (const impinge::error &error) {
      CHECK(error.status() == IMPINGE_ERROR_INVALID && strstr(error.what(), "the detector is in use") != nullptr);
    } catch (const std::exception &) {
      CHECK(!"it has its own exception");
    }
    const int before = n_calls;
    try {
      CHECK(detector.any(scene) && n_calls > before);
    } catch (const std::exception &) {
      CHECK(!"the detector is free");
    }
    turn = is_done;
  });
  is_first = true;
  try {
    detector.any(scene);
    CHECK(!"it has thrown");
  } catch (const std::runtime_error &error) {
    CHECK(strcmp(error.what(), "of the first") == 0);
  }
  second.join();
  is_first = false;
  CHECK(detector.any(scene) && std::string(detector.stats().backend) == "cpu");
}

} // namespace

int main() {
  each_has_its_own_exception();
  return finish("threads in C++");
}
