/* What is lent is not copied, what cannot be had is an error, and the environment is not read. Linked with --wrap for malloc and the like, so that all of the library's allocations are seen. */
#include "common.h"

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *at, size_t size);
int __real_posix_memalign(void **at, size_t alignment, size_t size);

static size_t most = SIZE_MAX, n_bytes = 0;
static int refuse(size_t size) {
  n_bytes += size;
  return size > most;
}
void *__wrap_malloc(size_t size) { return refuse(size) ? NULL : __real_malloc(size); }
void *__wrap_calloc(size_t n, size_t size) { return refuse(n * size) ? NULL : __real_calloc(n, size); }
void *__wrap_realloc(void *at, size_t size) { return refuse(size) ? NULL : __real_realloc(at, size); }
int __wrap_posix_memalign(void **at, size_t alignment, size_t size) {
  return refuse(size) ? 12 : __real_posix_memalign(at, alignment, size);
}

/* What the library reads of the environment, but the size of stacks, which Rust's standard library reads. */
char *__real_getenv(const char *name);
static int n_read = 0;
char *__wrap_getenv(const char *name) {
  if (strcmp(name, "RUST_MIN_STACK") != 0) {
    fprintf(stderr, "it reads %s\n", name);
    ++n_read;
  }
  return __real_getenv(name);
}

static int n_released = 0;
static void release(void *user) {
  ++n_released;
  ++*(int *)user;
}

int main(void) {
  static ball one, other, far_away;
  static double columns[3][VERTICES];
  int releases[4] = {0, 0, 0, 0};
  impinge_scene *scene = NULL;
  impinge_detector *detector = open_detector(1);
  impinge_pairs *pairs = NULL;
  impinge_motion *motion = NULL;
  impinge_array view, by_column;
  uint64_t hash;
  size_t i, j;
  make_ball(&one, 0);
  make_ball(&other, 0.9);
  make_ball(&far_away, 5);
  for (i = 0; i < VERTICES; ++i)
    for (j = 0; j < 3; ++j) columns[j][i] = other.positions[i][j];
  GOOD(impinge_scene_create(&scene));
  GOOD(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&one), NULL));
  GOOD(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&other), NULL));
  hash = hash_of(detector, scene, NULL);

  /* Lent rows are read where they lie. */
  n_bytes = 0;
  GOOD(impinge_scene_lend_positions(scene, 1, positions_of(&far_away), release, &releases[0]));
  CHECK(n_bytes > 0 && n_bytes < 200);
  GOOD(impinge_scene_positions(scene, 1, &view));
  CHECK(view.data == far_away.positions && n_released == 0);
  CHECK(hash_of(detector, scene, NULL) == 0);
  GOOD(impinge_scene_lend_end_positions(scene, 1, positions_of(&other), release, &releases[1]));
  GOOD(impinge_scene_end_positions(scene, 1, &view));
  CHECK(view.data == other.positions && n_released == 0);
  GOOD(impinge_advance(detector, scene, NULL, NULL, &motion));
  /* The scene forgets both; the motion needs neither. */
  GOOD(impinge_motion_apply(motion, scene));
  impinge_motion_destroy(motion);
  CHECK(releases[0] == 1 && releases[1] == 1);
  /* Ends are released when the body stands still. */
  for (i = 0; i < 3; ++i) {
    static const double unit[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    GOOD(impinge_scene_lend_end_positions(scene, 1, positions_of(&other), release, &releases[3]));
    CHECK(releases[3] == (int)i);
    if (i == 0) GOOD(impinge_scene_set_end_positions(scene, 1, packed(NULL, 0, 0)));
    if (i == 1) GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
    if (i == 2) GOOD(impinge_scene_set_transform(scene, 1, packed(unit, 4, IMPINGE_F64)));
    CHECK(releases[3] == (int)i + 1);
  }
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
  /* Rows that are not packed are copied, and released at once. */
  by_column = packed(columns, VERTICES, IMPINGE_F64);
  by_column.row_stride = sizeof(double);
  by_column.column_stride = VERTICES * sizeof(double);
  GOOD(impinge_scene_lend_positions(scene, 1, by_column, release, &releases[2]));
  CHECK(releases[2] == 1 && hash_of(detector, scene, NULL) == hash);
  /* Nothing is released that was not taken. */
  i = (size_t)n_released;
  view = positions_of(&other);
  --view.rows;
  REFUSED(impinge_scene_lend_positions(scene, 1, view, release, &releases[2]), "body 1");
  CHECK(n_released == (int)i);
  GOOD(impinge_scene_lend_positions(scene, 1, positions_of(&other), release, &releases[2]));
  CHECK(n_released == (int)i);
  GOOD(impinge_scene_remove(scene, 1));
  CHECK(releases[2] == 2 && releases[0] == 1);

  /* Set positions: packed rows are copied into memory that is there already. */
  GOOD(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&other), NULL));
  CHECK(hash_of(detector, scene, NULL) == hash && hash_of(detector, scene, NULL) == hash);
  n_bytes = 0;
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
  CHECK(n_bytes == 0);
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&other)));

  /* An allocator that refuses: the arrays of the input, then those of the answer. */
  most = 20000;
  CHECK(impinge_scene_add_triangles(scene, faces_of(&one), positions_of(&one), NULL) == IMPINGE_ERROR_OUT_OF_MEMORY);
  CHECK(strstr(impinge_error_message(), "out of memory") != NULL);
  CHECK(impinge_scene_set_positions(scene, 1, by_column) == IMPINGE_ERROR_OUT_OF_MEMORY);
  most = SIZE_MAX;
  CHECK(impinge_scene_n_bodies(scene) == 2 && hash_of(detector, scene, NULL) == hash);
  most = 2000;
  pairs = (impinge_pairs *)scene;
  CHECK(impinge_detect(detector, scene, NULL, &pairs) == IMPINGE_ERROR_OUT_OF_MEMORY && pairs == NULL);
  most = SIZE_MAX;
  CHECK(hash_of(detector, scene, NULL) == hash);
  {
    /* The answers about points and bounds: what was asked once has its working memory, the rows of the answer are new each time. */
    static double origins[VERTICES][3];
    impinge_query query;
    static int8_t places[VERTICES];
    static const size_t limits[] = {30000, 10000, 3000, 1000};
    impinge_closest *closest = NULL;
    impinge_hits *hits = NULL;
    impinge_array from = packed(origins, VERTICES, IMPINGE_F64), to = positions_of(&one);
    GOOD(impinge_find_closest(detector, scene, to, HUGE_VAL, NULL, &closest));
    impinge_closest_destroy(closest);
    GOOD(impinge_cast(detector, scene, from, to, 9, NULL, &hits));
    CHECK(impinge_hits_count(hits) == VERTICES);
    impinge_hits_destroy(hits);
    most = 50000; /* The rows of an answer have more bytes, and what the engine works with has less. */
    CHECK(impinge_find_closest(detector, scene, to, HUGE_VAL, NULL, &closest) == IMPINGE_ERROR_OUT_OF_MEMORY && closest == NULL);
    CHECK(impinge_cast(detector, scene, from, to, 9, NULL, &hits) == IMPINGE_ERROR_OUT_OF_MEMORY && hits == NULL);
    most = 1 << 30;
    impinge_query_default(&query);
    query.n_nearest = UINT32_MAX;
    CHECK(impinge_find_closest(detector, scene, to, HUGE_VAL, &query, &closest) == IMPINGE_ERROR_OUT_OF_MEMORY && closest == NULL);
    CHECK(strstr(impinge_error_message(), "nearest") != NULL);
    most = SIZE_MAX;
    /* What the engine works with too. */
    GOOD(impinge_contains(detector, scene, 0, from, places));
    for (j = 0; j < sizeof limits / sizeof *limits; ++j) {
      most = limits[j];
      CHECK(impinge_find_closest(detector, scene, to, HUGE_VAL, NULL, &closest) == IMPINGE_ERROR_OUT_OF_MEMORY && closest == NULL);
      CHECK(impinge_cast(detector, scene, from, to, 9, NULL, &hits) == IMPINGE_ERROR_OUT_OF_MEMORY && hits == NULL);
      CHECK(strstr(impinge_error_message(), "out of memory") != NULL);
      if (most < VERTICES) CHECK(impinge_contains(detector, scene, 0, from, places) == IMPINGE_ERROR_OUT_OF_MEMORY);
      most = SIZE_MAX;
    }
    GOOD(impinge_cast(detector, scene, from, to, 9, NULL, &hits));
    CHECK(impinge_hits_count(hits) == VERTICES);
    impinge_hits_destroy(hits);
  }
  {
    /* What has changed since an older answer, and weights by area. */
    impinge_pairs *old = NULL;
    impinge_changes *changes = (impinge_changes *)scene;
    impinge_near *near_pairs = NULL;
    impinge_stencils *stencils = (impinge_stencils *)scene;
    impinge_query query;
    static double at_rest[2 * VERTICES][3];
    impinge_array rest = packed(at_rest, 2 * VERTICES, IMPINGE_F64);
    memcpy(at_rest, one.positions, sizeof one.positions);
    memcpy(at_rest[VERTICES], other.positions, sizeof other.positions);
    GOOD(impinge_detect(detector, scene, NULL, &old));
    GOOD(impinge_detect(detector, scene, NULL, &pairs));
    impinge_query_default(&query);
    query.kinds = IMPINGE_VF | IMPINGE_EE;
    GOOD(impinge_find_near(detector, scene, 0.01, &query, &near_pairs));
    most = 1000; /* The rows of an answer have more bytes; areas of vertices and of edges too. */
    CHECK(impinge_pairs_changes(pairs, old, &changes) == IMPINGE_ERROR_OUT_OF_MEMORY && changes == NULL);
    CHECK(strstr(impinge_error_message(), "changes") != NULL);
    for (most = 1000; most < 60000; most *= 4)
      CHECK(impinge_near_stencils_by_area(near_pairs, scene, &rest, &stencils) == IMPINGE_ERROR_OUT_OF_MEMORY && stencils == NULL);
    most = SIZE_MAX;
    GOOD(impinge_pairs_changes(pairs, old, &changes));
    GOOD(impinge_near_stencils_by_area(near_pairs, scene, &rest, &stencils));
    impinge_stencils_destroy(stencils);
    impinge_changes_destroy(changes);
    impinge_near_destroy(near_pairs);
    impinge_pairs_destroy(old);
    impinge_pairs_destroy(pairs);
  }
  {
    /* As many threads as there are cores, also of the pool that matrices are shared by. */
    static double matrices[4096][3][3];
    impinge_detector *many = open_detector(0);
    CHECK(hash_of(many, scene, NULL) == hash);
    for (i = 0; i < 4096; ++i) matrices[i][0][0] = matrices[i][1][1] = matrices[i][2][2] = i % 2 ? -1 : 1;
    GOOD(impinge_project_psd(&matrices[0][0][0], 4096, 3));
    CHECK(matrices[1][0][0] == 0 && matrices[2][0][0] == 1);
    CHECK(n_read == 0);
    impinge_detector_destroy(many);
  }
  impinge_scene_destroy(scene);
  impinge_detector_destroy(detector);
  return finish("memory");
}
