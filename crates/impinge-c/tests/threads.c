/* Two threads, each with a detector of its own, ask about one scene at the same time. What one thread uses, it refuses to another that would
 * change it. */
#include "common.h"
#include <pthread.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

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
static const ball *moved = NULL;
static int is_asked = 0, n_refused = 0;

/* Asks the detector that is in use, changes the scene that it is asked about, and asks another detector about that. */
static void *ask_shared(void *user) {
  impinge_detector *own = open_detector(1);
  int32_t any = -1;
  (void)user;
  REFUSED(impinge_any(shared, scene, NULL, &any), "the detector is in use");
  REFUSED(impinge_scene_set_positions(scene, 1, positions_of(moved)), "the scene is in use: another call is reading it");
  CHECK(any == -1 && impinge_scene_n_bodies(scene) == 2);
  GOOD(impinge_any(own, scene, NULL, &any));
  CHECK(any == 1);
  impinge_detector_destroy(own);
  ++n_refused;
  return NULL;
}

/* Asks from another thread, while this one is in a question: once per question. */
static int while_in_use(void *user) {
  pthread_t other;
  (void)user;
  if (is_asked) return 0;
  is_asked = 1;
  CHECK(pthread_create(&other, NULL, ask_shared, NULL) == 0);
  CHECK(pthread_join(other, NULL) == 0);
  return 0;
}

static void in_use(void) {
  impinge_settings settings;
  int i;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.cancelled = while_in_use;
  GOOD(impinge_detector_create(&settings, &shared));
  for (i = 0; i < 2; ++i) {
    int32_t any = 0;
    is_asked = 0;
    GOOD(impinge_any(shared, scene, NULL, &any));
    CHECK(any == 1 && n_refused == i + 1);
  }
  impinge_detector_destroy(shared);
  /* Nothing is left of the questions. */
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(moved)));
}

/* Questions that still come, changes done, and changes and questions that were refused. */
static int n_asking = 0, n_changes = 0, n_changes_refused = 0, n_questions_refused = 0;

static int now(const int *of) { return __atomic_load_n(of, __ATOMIC_SEQ_CST); }
static void count(int *of) { __atomic_add_fetch(of, 1, __ATOMIC_SEQ_CST); }

/* Returns when the other thread has counted one more; after many seconds anyway, so that the checks at the end fail. */
static void await_more(const int *of) {
  const int before = now(of);
  int n;
  for (n = 0; n < 100000000 && now(of) == before; ++n) sched_yield();
}

/* Whether a call has done what it says, or has been refused because the scene is in use. */
static int is_done(impinge_status status, const char *why, int *n) {
  if (status == IMPINGE_OK) return 1;
  REFUSED(status, why);
  count(n);
  return 0;
}

/* Goes on with the question when a change was refused because of it. */
static int until_refused(void *is_waiting) {
  if (*(int *)is_waiting) await_more(&n_changes_refused);
  *(int *)is_waiting = 0;
  return 0;
}

static void *ask_on(void *hash) {
  impinge_settings settings;
  impinge_detector *detector = NULL;
  int n = 0, n_tries = 0, is_waiting = 0;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.threads = 1;
  settings.cancelled = until_refused;
  settings.user = &is_waiting;
  GOOD(impinge_detector_create(&settings, &detector));
  /* Until a question met a change, too: nothing holds a change up as a callback does a question. */
  while (n < 50 || (now(&n_questions_refused) == 0 && n_tries < 20000)) {
    impinge_pairs *pairs = NULL;
    ++n_tries;
    is_waiting = n % 10 == 5;
    if (!is_done(impinge_detect(detector, scene, NULL, &pairs), "the scene is in use: another call is changing it", &n_questions_refused)) continue;
    CHECK(impinge_pairs_hash(pairs) == *(uint64_t *)hash && !is_waiting);
    impinge_pairs_destroy(pairs);
    /* Changes do not queue: without a pause of both threads there may be none. */
    if (++n % 5 == 0) await_more(&n_changes);
  }
  impinge_detector_destroy(detector);
  __atomic_sub_fetch(&n_asking, 1, __ATOMIC_SEQ_CST);
  return NULL;
}

/* One thread changes a scene, and changes it back, while others ask about it: each call is refused or right. */
static void changed_meanwhile(void) {
  const char *in_use = "the scene is in use: another call is reading it";
  impinge_detector *detector = open_detector(1);
  const double point[3] = {9, 9, 9};
  const impinge_array far_away = packed(point, 1, IMPINGE_F64);
  uint64_t hash = hash_of(detector, scene, NULL);
  pthread_t threads[2];
  int i;
  n_asking = 2;
  for (i = 0; i < 2; ++i) CHECK(pthread_create(&threads[i], NULL, ask_on, &hash) == 0);
  while (now(&n_asking) > 0) {
    /* New memory with what was in the old: sanitizers see a question that still reads that. */
    uint32_t added;
    if (is_done(impinge_scene_add_points(scene, far_away, &added), in_use, &n_changes_refused))
      while (!is_done(impinge_scene_remove(scene, added), in_use, &n_changes_refused)) continue;
    if (is_done(impinge_scene_remesh(scene, 1, IMPINGE_TRIANGLES, faces_of(moved), positions_of(moved)), in_use, &n_changes_refused)) count(&n_changes);
  }
  for (i = 0; i < 2; ++i) CHECK(pthread_join(threads[i], NULL) == 0);
  /* The pauses and the callbacks of either thread alone make as many. */
  CHECK(n_changes >= 10 && n_changes_refused >= 5 && n_questions_refused > 0);
  CHECK(hash_of(detector, scene, NULL) == hash);
  impinge_detector_destroy(detector);
}

/* A forked process has no threads of its parent: a detector of the parent answers alone, and a new one starts threads. */
static void forked(void) {
  impinge_detector *detector = open_detector(2);
  uint64_t hash = hash_of(detector, scene, NULL);
  int ended = -1;
  pid_t child = fork();
  if (child == 0) {
    alarm(60);
    CHECK(hash_of(detector, scene, NULL) == hash);
    impinge_detector_destroy(detector);
    detector = open_detector(2);
    CHECK(hash_of(detector, scene, NULL) == hash);
    impinge_detector_destroy(detector);
    _exit(n_failed != 0);
  }
  CHECK(waitpid(child, &ended, 0) == child && ended == 0);
  impinge_detector_destroy(detector);
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
  moved = &other;
  in_use();
  changed_meanwhile();
#ifndef __SANITIZE_THREAD__ /* It allows no new threads in a fork. */
  forked();
#endif
  impinge_scene_destroy(scene);
  return finish("threads");
}
