/* Two threads, each with a detector of its own, ask about one scene at the same time. One detector refuses the question of a second thread. */
#include "common.h"
#include <pthread.h>

static impinge_scene *scene = NULL;

static void *ask(void *hash) {
  impinge_detector *detector = open_detector(2);
  int i;
  for (i = 0; i < 20; ++i) {
    impinge_impacts *impacts = NULL;
    int32_t any = 0;
    CHECK(impinge_any(detector, scene, NULL, &any) == IMPINGE_OK && any == 1);
    GOOD(impinge_find_impacts(detector, scene, NULL, &impacts));
    *(uint64_t *)hash = hash_of(detector, scene, NULL) + impinge_impacts_hash(impacts);
    impinge_impacts_destroy(impacts);
  }
  /* Each thread has a message of its own. */
  REFUSED(impinge_any(detector, NULL, NULL, NULL), "scene is NULL");
  impinge_detector_destroy(detector);
  return NULL;
}

static impinge_detector *shared = NULL;
static int n_refused = 0;

static void *ask_shared(void *user) {
  int32_t any = -1;
  (void)user;
  REFUSED(impinge_any(shared, scene, NULL, &any), "the detector is in use");
  CHECK(any == -1);
  return NULL;
}

/* Asks from another thread, while this one is in a question. */
static int while_in_use(void *user) {
  pthread_t other;
  (void)user;
  if (n_refused++ > 0) return 0;
  CHECK(pthread_create(&other, NULL, ask_shared, NULL) == 0);
  CHECK(pthread_join(other, NULL) == 0);
  return 0;
}

static void in_use(void) {
  impinge_settings settings;
  int32_t any = 0;
  int i;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.cancelled = while_in_use;
  GOOD(impinge_detector_create(&settings, &shared));
  for (i = 0; i < 2; ++i) {
    GOOD(impinge_any(shared, scene, NULL, &any));
    CHECK(any == 1 && n_refused > 0);
  }
  impinge_detector_destroy(shared);
}

int main(void) {
  static ball one, other;
  pthread_t threads[2];
  uint64_t hashes[3] = {0, 0, 0};
  int i;
  make_ball(&one, 0);
  make_ball(&other, 0.9);
  GOOD(impinge_scene_create(&scene));
  GOOD(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&one), NULL));
  GOOD(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&other), NULL));
  for (i = 0; i < 2; ++i) CHECK(pthread_create(&threads[i], NULL, ask, &hashes[i]) == 0);
  for (i = 0; i < 2; ++i) CHECK(pthread_join(threads[i], NULL) == 0);
  CHECK(strlen(impinge_error_message()) == 0);
  ask(&hashes[2]);
  CHECK(hashes[0] != 0 && hashes[0] == hashes[1] && hashes[1] == hashes[2]);
  in_use();
  impinge_scene_destroy(scene);
  return finish("threads");
}
