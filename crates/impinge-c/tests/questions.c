/* Every question once, on two balls whose answers are known from geometry or from another question. */
#ifdef TEST_PANIC
#define _POSIX_C_SOURCE 200809L
#include <unistd.h>
#endif
#include "common.h"

static ball balls[2];

static impinge_scene *two_balls(void) {
  impinge_scene *scene = NULL;
  uint32_t body = 7, which;
  GOOD(impinge_scene_create(&scene));
  for (which = 0; which < 2; ++which) {
    GOOD(impinge_scene_add_triangles(scene, faces_of(&balls[which]), positions_of(&balls[which]), &body));
    CHECK(body == which);
  }
  CHECK(impinge_scene_n_bodies(scene) == 2);
  return scene;
}

/* The same numbers in other places and types give the same pairs. */
static void arrays(impinge_detector *detector) {
  static double columns[3][VERTICES], wide[VERTICES][5];
  static float narrow[VERTICES][3];
  static int64_t faces[FACES][4];
  static int32_t by_column[3][FACES];
  impinge_scene *scene = two_balls(), *other = NULL;
  uint64_t hash = hash_of(detector, scene, NULL);
  impinge_array at, of;
  size_t i, j;
  CHECK(hash != 0);
  for (i = 0; i < VERTICES; ++i)
    for (j = 0; j < 3; ++j) {
      columns[j][i] = wide[VERTICES - 1 - i][j + 1] = balls[0].positions[i][j];
      narrow[i][j] = (float)balls[0].positions[i][j];
    }
  for (i = 0; i < FACES; ++i)
    for (j = 0; j < 3; ++j) faces[i][j + 1] = by_column[j][i] = (int32_t)balls[0].faces[i][j];
  GOOD(impinge_scene_create(&other));
  at = packed(columns, VERTICES, IMPINGE_F64);
  at.row_stride = sizeof(double);
  at.column_stride = VERTICES * sizeof(double);
  of = packed(&faces[0][1], FACES, IMPINGE_I64);
  of.row_stride = 4 * sizeof(int64_t);
  of.column_stride = sizeof(int64_t);
  GOOD(impinge_scene_add_triangles(other, of, at, NULL));
  GOOD(impinge_scene_add_triangles(other, faces_of(&balls[1]), positions_of(&balls[1]), NULL));
  CHECK(hash_of(detector, other, NULL) == hash);
  /* Rows from the last to the first, in wider rows. */
  at = packed(&wide[VERTICES - 1][1], VERTICES, IMPINGE_F64);
  at.row_stride = -(ptrdiff_t)sizeof wide[0];
  at.column_stride = sizeof(double);
  GOOD(impinge_scene_set_positions(other, 0, at));
  CHECK(hash_of(detector, other, NULL) == hash);
  of = packed(by_column, FACES, IMPINGE_I32);
  of.row_stride = sizeof(int32_t);
  of.column_stride = FACES * sizeof(int32_t);
  GOOD(impinge_scene_remesh(other, 0, IMPINGE_TRIANGLES, of, positions_of(&balls[0])));
  CHECK(hash_of(detector, other, NULL) == hash);
  /* Rounded positions are others, and may be of another type. */
  GOOD(impinge_scene_set_positions(other, 0, packed(narrow, VERTICES, IMPINGE_F32)));
  GOOD(impinge_scene_positions(other, 0, &at));
  CHECK(at.type == IMPINGE_F32 && at.rows == VERTICES && ((const float *)at.data)[3] == narrow[1][0]);
  GOOD(impinge_scene_elements(other, 0, &of));
  CHECK(of.type == IMPINGE_U32 && of.rows == FACES && memcmp(of.data, balls[0].faces, sizeof balls[0].faces) == 0);
  GOOD(impinge_scene_edges(other, 0, &of));
  CHECK(of.rows == FACES * 3 / 2);
  GOOD(impinge_scene_end_positions(other, 0, &of));
  CHECK(of.rows == 0);
  impinge_scene_destroy(other);
  impinge_scene_destroy(scene);
}

static void pairs_of_bodies(impinge_detector *detector) {
  impinge_scene *scene = two_balls();
  impinge_query query;
  impinge_exclusion exclusion;
  impinge_stats stats;
  impinge_pairs *pairs = NULL;
  impinge_array rows;
  uint64_t n = 0, all = hash_of(detector, scene, NULL);
  int32_t any = -1;
  impinge_query_default(&query);
  CHECK(query.between == 1 && query.self == 1 && query.shared_vertex == IMPINGE_RESOLVE && query.a == IMPINGE_ANY_BODY);
  CHECK(hash_of(detector, scene, &query) == all);
  query.a = 0;
  query.b = 1;
  CHECK(hash_of(detector, scene, &query) == all);
  GOOD(impinge_detect(detector, scene, &query, &pairs));
  CHECK(impinge_pairs_count(pairs) > 100 && impinge_pairs_data(pairs)->body_a == 0 && impinge_pairs_data(pairs)->body_b == 1);
  GOOD(impinge_pairs_column(pairs, IMPINGE_COLUMN_ROWS, &rows));
  CHECK(rows.data == impinge_pairs_data(pairs) && rows.rows == impinge_pairs_count(pairs) && rows.type == IMPINGE_U32);
  GOOD(impinge_count(detector, scene, NULL, &n));
  CHECK(n == impinge_pairs_count(pairs));
  memset(&stats, 0, sizeof stats);
  stats.size = sizeof stats;
  GOOD(impinge_pairs_stats(pairs, &stats));
  CHECK(stats.n_candidates >= n && strcmp(stats.backend, "cpu") == 0 && stats.total_ms > 0 && stats.bytes_held > 0);
  stats.size = offsetof(impinge_stats, n_unsure);
  stats.n_unsure = 12345;
  GOOD(impinge_detector_stats(detector, &stats));
  CHECK(stats.n_unsure == 12345 && stats.n_threads == 2);
  impinge_pairs_destroy(pairs);
  /* No ball meets itself. */
  query.b = IMPINGE_ANY_BODY;
  query.between = 0;
  GOOD(impinge_any(detector, scene, &query, &any));
  CHECK(any == 0);
  query.between = 1;
  query.self = 0;
  CHECK(hash_of(detector, scene, &query) == all);
  query.a = IMPINGE_ANY_BODY;
  memset(&exclusion, 0, sizeof exclusion);
  exclusion.kind = IMPINGE_EXCLUDE_BODIES;
  exclusion.b = 1;
  query.exclusions = &exclusion;
  query.n_exclusions = 1;
  CHECK(hash_of(detector, scene, &query) == 0);
  query.n_exclusions = 0;
  /* Two cells have each pair once. */
  query.flags = IMPINGE_CELL;
  query.cell_low[0] = query.cell_low[1] = query.cell_low[2] = -HUGE_VAL;
  query.cell_high[0] = query.cell_high[1] = HUGE_VAL;
  query.cell_high[2] = 0.1;
  n = hash_of(detector, scene, &query);
  CHECK(n != 0 && n != all);
  query.cell_low[2] = 0.1;
  query.cell_high[2] = HUGE_VAL;
  CHECK(n + hash_of(detector, scene, &query) == all);
  /* Bodies that do not meet, a body that moved away, and one that is gone. */
  GOOD(impinge_scene_set_filter(scene, 0, 2, 1));
  GOOD(impinge_scene_set_filter(scene, 1, 2, 1));
  GOOD(impinge_any(detector, scene, NULL, &any));
  CHECK(any == 0);
  GOOD(impinge_scene_set_filter(scene, 0, 1, UINT64_MAX));
  GOOD(impinge_scene_set_filter(scene, 1, 1, UINT64_MAX));
  CHECK(hash_of(detector, scene, NULL) == all);
  {
    double away[4][4] = {{1, 0, 0, 9}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}, back[4][4];
    impinge_array matrix = packed(away, 4, IMPINGE_F64);
    GOOD(impinge_scene_set_transform(scene, 1, matrix));
    CHECK(hash_of(detector, scene, NULL) == 0);
    /* Its transpose, read by columns. */
    memset(back, 0, sizeof back);
    back[0][0] = back[1][1] = back[2][2] = back[3][3] = 1;
    matrix = packed(back, 4, IMPINGE_F64);
    matrix.row_stride = sizeof(double);
    matrix.column_stride = 4 * sizeof(double);
    GOOD(impinge_scene_set_transform(scene, 1, matrix));
    CHECK(hash_of(detector, scene, NULL) == all);
    /* The same motion as the end of a step. */
    {
      impinge_array end;
      impinge_impact first;
      int32_t found = -1;
      GOOD(impinge_scene_set_end_transform(scene, 1, packed(away, 4, IMPINGE_F64)));
      GOOD(impinge_scene_end_positions(scene, 1, &end));
      CHECK(end.rows == VERTICES && ((const double(*)[3])end.data)[5][0] == balls[1].positions[5][0] + 9);
      GOOD(impinge_find_earliest(detector, scene, NULL, &first, &found));
      CHECK(found == 1 && first.toi == 0 && first.at_start == 1);
      REFUSED(impinge_scene_set_end_transform(scene, 1, packed(away, 3, IMPINGE_F64)), "3 rows");
    }
  }
  GOOD(impinge_scene_remove(scene, 0));
  CHECK(impinge_scene_n_bodies(scene) == 1 && hash_of(detector, scene, NULL) == 0);
  REFUSED(impinge_scene_remove(scene, 0), "no body 0");
  {
    uint32_t body = 9;
    GOOD(impinge_scene_add_triangles(scene, faces_of(&balls[0]), positions_of(&balls[0]), &body));
    CHECK(body == 0 && hash_of(detector, scene, NULL) == all);
  }
  impinge_scene_destroy(scene);
}

/* Lets no vertex of the upper half of the first ball touch anything. */
static int lower_half(void *user, const impinge_element *a, const impinge_element *b) {
  uint32_t i;
  CHECK(user == &balls && a->n_vertices + b->n_vertices == 4);
  for (i = 0; i < a->n_vertices; ++i)
    if (a->body == 0 && balls[0].positions[a->vertices[i]][2] > 0) return 0;
  for (i = 0; i < b->n_vertices; ++i)
    if (b->body == 0 && balls[0].positions[b->vertices[i]][2] > 0) return 0;
  return 1;
}

/* The second ball comes from afar: it stops 1e-3 before the first one. */
static void steps(impinge_detector *detector) {
  static ball far_away;
  impinge_scene *scene = two_balls();
  impinge_step step;
  impinge_impacts *impacts = NULL;
  impinge_impact first, again;
  impinge_motion *motion = NULL;
  impinge_nearest nearest;
  impinge_array view;
  double fraction = -1;
  int32_t found = -1, is_free = -1;
  make_ball(&far_away, 5);
  impinge_step_default(&step);
  /* As they are, the balls touch at the start, and the start intersects. */
  GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(&far_away)));
  step.start = IMPINGE_START_VERIFY;
  GOOD(impinge_is_free(detector, scene, &step, &is_free));
  CHECK(is_free == 0 && impinge_detector_start_intersects(detector) == 1);
  GOOD(impinge_advance(detector, scene, &step, &fraction, NULL));
  CHECK(fraction == 0);
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
  GOOD(impinge_find_distance(detector, scene, 0, 1, &nearest, &found));
  CHECK(found == 1 && fabs(nearest.distance - 3) < 0.01 && nearest.body_a == 0 && nearest.body_b == 1);
  CHECK(fabs(nearest.points[1][0] - nearest.points[0][0] - nearest.distance) < 1e-9);
  GOOD(impinge_is_free(detector, scene, &step, &is_free));
  CHECK(is_free == 1 && impinge_detector_start_intersects(detector) == 0);
  GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(&balls[1])));
  GOOD(impinge_is_free(detector, scene, &step, &is_free));
  CHECK(is_free == 0);
  step.precision = IMPINGE_F64;
  GOOD(impinge_find_impacts(detector, scene, &step, &impacts));
  CHECK(impinge_impacts_count(impacts) > 100 && impinge_impacts_start_intersects(impacts) == 0);
  CHECK(impinge_impacts_hash(impacts) == impinge_hash_impacts(impinge_impacts_data(impacts), impinge_impacts_count(impacts)));
  GOOD(impinge_find_earliest(detector, scene, &step, &first, &found));
  CHECK(found == 1 && fabs(first.toi * 4.1 - nearest.distance) < 1e-6 && first.at_start == 0);
  GOOD(impinge_impacts_column(impacts, IMPINGE_COLUMN_TOI, &view));
  {
    size_t i;
    double least = 2;
    for (i = 0; i < view.rows; ++i) {
      double toi = *(const double *)((const char *)view.data + (ptrdiff_t)i * view.row_stride);
      if (toi < least) least = toi;
    }
    CHECK(least == first.toi);
  }
  GOOD(impinge_impacts_column(impacts, IMPINGE_COLUMN_ROWS, &view));
  CHECK(((const uint32_t *)view.data)[0] == impinge_impacts_data(impacts)->body_a);
  REFUSED(impinge_impacts_column(impacts, IMPINGE_COLUMN_SHAPE, &view), "no column");
  {
    impinge_impacts *lower = NULL;
    size_t i, n = 0;
    step.passes = lower_half;
    step.passes_user = &balls;
    GOOD(impinge_find_impacts(detector, scene, &step, &lower));
    for (i = 0; i < impinge_impacts_count(lower); ++i) {
      const impinge_impact *of = &impinge_impacts_data(lower)[i];
      if (of->kind == IMPINGE_VF && of->body_a == 0) CHECK(balls[0].positions[of->element_a][2] <= 0 && ++n);
    }
    CHECK(n > 10 && impinge_impacts_count(lower) < impinge_impacts_count(impacts));
    impinge_impacts_destroy(lower);
    REFUSED(impinge_count(detector, scene, &step, &(uint64_t){0}), "passes");
    step.passes = NULL;
  }
  impinge_impacts_destroy(impacts);
  step.clearance = 1e-3;
  GOOD(impinge_advance(detector, scene, &step, &fraction, &motion));
  CHECK(fraction == impinge_motion_fraction(motion) && fraction < first.toi && fraction > first.toi - 1e-3);
  CHECK(impinge_motion_start_intersects(motion) == 0);
  GOOD(impinge_motion_first(motion, &again, &found));
  CHECK(found == 1 && again.kind == first.kind);
  GOOD(impinge_motion_positions(motion, 0, &view));
  CHECK(view.rows == 0);
  GOOD(impinge_motion_positions(motion, 1, &view));
  CHECK(view.rows == VERTICES && view.type == IMPINGE_F64);
  GOOD(impinge_motion_apply(motion, scene));
  GOOD(impinge_find_distance(detector, scene, 1, 0, &nearest, &found));
  CHECK(found == 1 && nearest.distance >= 1e-3 && nearest.distance < 1.001e-3 && nearest.body_a == 1);
  impinge_motion_destroy(motion);
  /* Nobody moves after a step was taken. */
  GOOD(impinge_find_earliest(detector, scene, &step, &first, &found));
  CHECK(found == 0);
  GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(&balls[1])));
  GOOD(impinge_scene_set_end_positions(scene, 1, packed(NULL, 0, IMPINGE_F64)));
  GOOD(impinge_is_free(detector, scene, &step, &is_free));
  CHECK(is_free == 1);
  impinge_scene_destroy(scene);
}

static int stop_after(void *user, uint32_t kind, const impinge_pair *rows, size_t n) {
  size_t *left = user;
  CHECK(n > 0 && rows != NULL && kind == IMPINGE_EE);
  *left = n < *left ? *left - n : 0;
  return *left == 0;
}

static void near_and_candidates(impinge_detector *detector) {
  impinge_scene *scene = two_balls();
  impinge_candidates *candidates = NULL;
  impinge_near *near_pairs = NULL, *thick = NULL;
  impinge_array view;
  impinge_query query;
  uint64_t n = 0;
  size_t left = 500, i;
  impinge_query_default(&query);
  query.self = 0;
  query.kinds = IMPINGE_EE;
  GOOD(impinge_find_candidates(detector, scene, 0.01, &query, &candidates));
  CHECK(impinge_candidates_count(candidates) > 500);
  GOOD(impinge_candidates_column(candidates, IMPINGE_COLUMN_KIND, &view));
  CHECK(view.type == IMPINGE_U8 && ((const uint8_t *)view.data)[0] == IMPINGE_EE);
  GOOD(impinge_find_candidates_in_runs(detector, scene, 0.01, &query, 100, stop_after, &left, &n));
  CHECK(left == 0 && n >= 500 && n < impinge_candidates_count(candidates));
  impinge_candidates_destroy(candidates);
  query.kinds = 0;
  query.flags = IMPINGE_CLOSEST_POINTS;
  GOOD(impinge_find_near(detector, scene, 0.01, &query, &near_pairs));
  CHECK(impinge_near_count(near_pairs) > 100);
  GOOD(impinge_near_column(near_pairs, IMPINGE_COLUMN_DISTANCE, &view));
  for (i = 0; i < view.rows; ++i) CHECK(((const double *)view.data)[i] <= 0.01 + 1e-15);
  GOOD(impinge_near_column(near_pairs, IMPINGE_COLUMN_POINTS, &view));
  CHECK(view.rows == impinge_near_count(near_pairs) && view.row_stride == 48);
  /* A body as thick as the distance. */
  GOOD(impinge_scene_set_thickness(scene, 0, 0.01));
  query.flags = 0;
  GOOD(impinge_find_near(detector, scene, 0, &query, &thick));
  CHECK(impinge_near_hash(thick) == impinge_near_hash(near_pairs));
  REFUSED(impinge_near_column(thick, IMPINGE_COLUMN_DISTANCE, &view), "did not ask");
  {
    /* From a list, and again where nothing has moved. */
    impinge_settings settings;
    impinge_detector *listing = NULL;
    impinge_settings_default(&settings);
    settings.backend = IMPINGE_BACKEND_CPU;
    settings.reuse_margin = 0.01;
    GOOD(impinge_detector_create(&settings, &listing));
    for (i = 0; i < 3; ++i) {
      impinge_near *listed = NULL;
      GOOD(impinge_find_near(listing, scene, 0, &query, &listed));
      CHECK(impinge_near_hash(listed) == impinge_near_hash(near_pairs));
      impinge_near_destroy(listed);
    }
    impinge_detector_destroy(listing);
  }
  impinge_near_destroy(thick);
  impinge_near_destroy(near_pairs);
  impinge_scene_destroy(scene);
}

static uint32_t kind_of(const impinge_near *near_pairs, size_t ix) {
  impinge_array view;
  GOOD(impinge_near_column(near_pairs, IMPINGE_COLUMN_KIND, &view));
  return ((const uint8_t *)view.data)[ix];
}

/* Changes against a search of each row in the other answer. Rows are kind, body_a, element_a, body_b, element_b. */
typedef uint32_t named[5];
static size_t find_row(const named *rows, size_t n, const named row) {
  size_t i = 0;
  while (i < n && memcmp(rows[i], row, sizeof(named)) != 0) ++i;
  return i;
}
static void check_changes(impinge_changes *changes, const named *old, size_t n_old, const named *new_rows, size_t n_new, size_t *n_kept) {
  impinge_array kept, added, gone;
  size_t i, k = 0, a = 0, g = 0;
  GOOD(impinge_changes_column(changes, IMPINGE_COLUMN_KEPT, &kept));
  GOOD(impinge_changes_column(changes, IMPINGE_COLUMN_NEW, &added));
  GOOD(impinge_changes_column(changes, IMPINGE_COLUMN_GONE, &gone));
  CHECK(kept.type == IMPINGE_U64 && added.type == IMPINGE_U64 && gone.type == IMPINGE_U64);
  for (i = 0; i < n_old; ++i) {
    size_t at = find_row(new_rows, n_new, old[i]);
    if (at == n_new) {
      CHECK(g < gone.rows && ((const uint64_t *)gone.data)[g] == i);
      ++g;
    } else {
      CHECK(k < kept.rows && ((const uint64_t *)kept.data)[2 * k] == i && ((const uint64_t *)kept.data)[2 * k + 1] == at);
      ++k;
    }
  }
  for (i = 0; i < n_new; ++i) {
    if (find_row(old, n_old, new_rows[i]) < n_old) continue;
    CHECK(a < added.rows && ((const uint64_t *)added.data)[a] == i);
    ++a;
  }
  CHECK(k == kept.rows && a == added.rows && g == gone.rows);
  *n_kept = k;
  impinge_changes_destroy(changes);
}
enum { MOST_ROWS = 40000 };
static size_t name_near(const impinge_near *of, named *rows) {
  size_t i, n = impinge_near_count(of);
  CHECK(n < MOST_ROWS);
  for (i = 0; i < n; ++i) {
    rows[i][0] = kind_of(of, i);
    memcpy(&rows[i][1], &impinge_near_data(of)[i], sizeof(impinge_pair));
  }
  return n;
}
static size_t name_impacts(const impinge_impacts *of, named *rows) {
  size_t i, n = impinge_impacts_count(of);
  CHECK(n < MOST_ROWS);
  for (i = 0; i < n; ++i) {
    const impinge_impact *row = &impinge_impacts_data(of)[i];
    rows[i][0] = row->kind, rows[i][1] = row->body_a, rows[i][2] = row->element_a, rows[i][3] = row->body_b, rows[i][4] = row->element_b;
  }
  return n;
}
static size_t name_pairs(const impinge_pairs *of, named *rows) {
  size_t i, n = impinge_pairs_count(of);
  CHECK(n < MOST_ROWS);
  for (i = 0; i < n; ++i) {
    rows[i][0] = 0;
    memcpy(&rows[i][1], &impinge_pairs_data(of)[i], sizeof(impinge_pair));
  }
  return n;
}

/* What an older answer has too, is new and is gone; with the library's numbers of edges, and with the caller's. */
static void changes(impinge_detector *detector) {
  static named rows[2][MOST_ROWS];
  static ball moved, far_away;
  impinge_scene *scene;
  impinge_pairs *pairs[2] = {NULL, NULL};
  impinge_near *near_pairs[2] = {NULL, NULL};
  impinge_impacts *impacts[2] = {NULL, NULL};
  impinge_changes *found = (impinge_changes *)rows;
  impinge_array view;
  impinge_query query;
  size_t n[2], kept;
  uint32_t body = 7;
  int round, ix;
  make_ball(&moved, 0.93);
  make_ball(&far_away, 2.2);
  impinge_query_default(&query);
  query.self = 0;
  query.kinds = IMPINGE_VF | IMPINGE_EE;
  for (round = 0; round < 2; ++round) {
    scene = two_balls();
    if (round == 1) {
      static uint32_t edges[3 * FACES][2];
      size_t i;
      GOOD(impinge_scene_edges(scene, 1, &view));
      CHECK(view.rows < 3 * FACES);
      for (i = 0; i < view.rows; ++i) {
        const uint32_t *row = (const uint32_t *)((const char *)view.data + (ptrdiff_t)(view.rows - 1 - i) * view.row_stride);
        edges[i][0] = row[1], edges[i][1] = row[0];
      }
      GOOD(impinge_scene_set_edges(scene, 1, packed(edges, view.rows, IMPINGE_U32)));
    }
    for (ix = 0; ix < 2; ++ix) {
      GOOD(impinge_scene_set_end_positions(scene, 1, packed(NULL, 0, IMPINGE_F64)));
      GOOD(impinge_scene_set_positions(scene, 1, positions_of(ix ? &moved : &balls[1])));
      GOOD(impinge_detect(detector, scene, NULL, &pairs[ix]));
      GOOD(impinge_find_near(detector, scene, 0.01, &query, &near_pairs[ix]));
      GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
      GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(ix ? &moved : &balls[1])));
      GOOD(impinge_find_impacts(detector, scene, NULL, &impacts[ix]));
    }
    GOOD(impinge_pairs_changes(pairs[1], pairs[0], &found));
    for (ix = 0; ix < 2; ++ix) n[ix] = name_pairs(pairs[ix], rows[ix]);
    check_changes(found, (const named *)rows[0], n[0], (const named *)rows[1], n[1], &kept);
    CHECK(kept > 10 && kept < n[0] && kept < n[1]);
    GOOD(impinge_near_changes(near_pairs[1], near_pairs[0], &found));
    for (ix = 0; ix < 2; ++ix) n[ix] = name_near(near_pairs[ix], rows[ix]);
    check_changes(found, (const named *)rows[0], n[0], (const named *)rows[1], n[1], &kept);
    CHECK(kept > 10 && kept < n[0] && kept < n[1]);
    GOOD(impinge_impacts_changes(impacts[1], impacts[0], &found));
    for (ix = 0; ix < 2; ++ix) n[ix] = name_impacts(impacts[ix], rows[ix]);
    check_changes(found, (const named *)rows[0], n[0], (const named *)rows[1], n[1], &kept);
    CHECK(kept > 10 && kept < n[0]);
    /* Another body in the same place has no pair in common. */
    GOOD(impinge_scene_remove(scene, 1));
    GOOD(impinge_scene_add_triangles(scene, faces_of(&moved), positions_of(&moved), &body));
    CHECK(body == 1);
    impinge_pairs_destroy(pairs[0]);
    GOOD(impinge_detect(detector, scene, NULL, &pairs[0]));
    CHECK(impinge_pairs_hash(pairs[0]) == impinge_pairs_hash(pairs[1]));
    GOOD(impinge_pairs_changes(pairs[1], pairs[0], &found));
    GOOD(impinge_changes_column(found, IMPINGE_COLUMN_KEPT, &view));
    CHECK(view.rows == 0);
    GOOD(impinge_changes_column(found, IMPINGE_COLUMN_GONE, &view));
    CHECK(view.rows == impinge_pairs_count(pairs[0]));
    REFUSED(impinge_changes_column(found, IMPINGE_COLUMN_ROWS, &view), "changes have no column 2");
    impinge_changes_destroy(found);
    REFUSED(impinge_pairs_changes(pairs[1], NULL, &found), "old is NULL");
    CHECK(found == NULL);
    for (ix = 0; ix < 2; ++ix) {
      impinge_pairs_destroy(pairs[ix]);
      impinge_near_destroy(near_pairs[ix]);
      impinge_impacts_destroy(impacts[ix]);
    }
    impinge_scene_destroy(scene);
  }
}

static double area_of(const ball *of, size_t face) {
  const double *p = of->positions[of->faces[face][0]], *q = of->positions[of->faces[face][1]], *r = of->positions[of->faces[face][2]];
  double u[3], v[3], sum = 0;
  int k;
  for (k = 0; k < 3; ++k) u[k] = q[k] - p[k], v[k] = r[k] - p[k];
  for (k = 0; k < 3; ++k) sum += pow(u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3], 2);
  return sqrt(sum) / 2;
}

/* What a potential needs: against distances, the balance of forces, and another order of numbers. */
static void stencils(impinge_detector *detector) {
  impinge_scene *scene = two_balls();
  impinge_near *near_pairs = NULL;
  impinge_stencils *of = NULL, *merged = NULL, *plain = NULL;
  impinge_array view, distances, rest, vertices, gradients, hessians, weights;
  static double at_rest[2 * VERTICES][3];
  double matrices[2][9] = {{2, 0, 0, 0, -1, 0, 0, 0, 0.5}, {-1, 0, 0, 0, -1, 0, 0, 0, -1}};
  static double many[1000][9], copies[1000][9];
  impinge_query query;
  double total = 0;
  size_t i, j, k, n;
  impinge_query_default(&query);
  query.self = 0;
  query.kinds = IMPINGE_FF;
  GOOD(impinge_find_near(detector, scene, 0.01, &query, &near_pairs));
  REFUSED(impinge_near_stencils(near_pairs, scene, NULL, &of), "kinds: ff");
  CHECK(of == NULL);
  impinge_near_destroy(near_pairs);
  query.kinds = IMPINGE_VF | IMPINGE_EE;
  query.flags = IMPINGE_DISTANCES;
  GOOD(impinge_find_near(detector, scene, 0.01, &query, &near_pairs));
  n = impinge_near_count(near_pairs);
  memcpy(at_rest, balls[0].positions, sizeof balls[0].positions);
  memcpy(at_rest[VERTICES], balls[1].positions, sizeof balls[1].positions);
  rest = packed(at_rest, 2 * VERTICES, IMPINGE_F64);
  GOOD(impinge_near_stencils(near_pairs, scene, &rest, &of));
  CHECK(n > 50 && impinge_stencils_count(of) == n);
  GOOD(impinge_near_column(near_pairs, IMPINGE_COLUMN_DISTANCE, &distances));
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_SQUARED_DISTANCE, &view));
  CHECK(view.rows == n && view.row_stride == sizeof(double) && view.type == IMPINGE_F64);
  for (i = 0; i < n; ++i) CHECK(fabs(((const double *)view.data)[i] - pow(((const double *)distances.data)[i], 2)) < 1e-12);
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_VERTICES, &vertices));
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_GRADIENT, &gradients));
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_HESSIAN, &hessians));
  CHECK(vertices.row_stride == 4 * sizeof(uint32_t) && gradients.row_stride == 12 * sizeof(double) && hessians.row_stride == 144 * sizeof(double));
  for (i = 0; i < n; ++i) {
    const double *gradient = (const double *)gradients.data + 12 * i, *hessian = (const double *)hessians.data + 144 * i;
    for (k = 0; k < 4; ++k) CHECK(((const uint32_t *)vertices.data)[4 * i + k] < 2 * VERTICES);
    for (k = 0; k < 3; ++k) {
      CHECK(fabs(gradient[k] + gradient[3 + k] + gradient[6 + k] + gradient[9 + k]) < 1e-12);
      for (j = 0; j < 12; ++j) CHECK(fabs(hessian[12 * k + j] - hessian[12 * j + k]) == 0);
    }
  }
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_STARTS, &view));
  CHECK(view.rows == 3 && view.type == IMPINGE_U64 && ((const uint64_t *)view.data)[1] == VERTICES && ((const uint64_t *)view.data)[2] == 2 * VERTICES);
  GOOD(impinge_stencils_merged(of, &merged));
  GOOD(impinge_stencils_column(merged, IMPINGE_COLUMN_WEIGHT, &weights));
  CHECK(weights.rows == impinge_stencils_count(merged) && weights.rows < n);
  for (i = 0; i < weights.rows; ++i) total += ((const double *)weights.data)[i];
  CHECK(total == (double)n);
  for (i = IMPINGE_COLUMN_COEFFICIENTS; i <= IMPINGE_COLUMN_MOLLIFIER_HESSIAN; ++i) {
    GOOD(impinge_stencils_column(merged, (uint32_t)i, &view));
    CHECK(view.rows == weights.rows && view.type == IMPINGE_F64);
  }
  GOOD(impinge_stencils_column(merged, IMPINGE_COLUMN_KIND, &view));
  CHECK(view.type == IMPINGE_U8 && ((const uint8_t *)view.data)[view.rows - 1] >= ((const uint8_t *)view.data)[0]);
  GOOD(impinge_stencils_column(merged, IMPINGE_COLUMN_FEATURES, &view));
  CHECK(view.row_stride == 2 && view.type == IMPINGE_U8);
  /* Without positions at rest there is no mollifier. */
  GOOD(impinge_near_stencils(near_pairs, scene, NULL, &plain));
  GOOD(impinge_stencils_column(plain, IMPINGE_COLUMN_MOLLIFIER, &view));
  for (i = 0; i < n; ++i) CHECK(((const double *)view.data)[i] == 1);
  REFUSED(impinge_stencils_column(plain, IMPINGE_COLUMN_TOI, &view), "no column 7");
  impinge_stencils_destroy(of);
  /* By area: the weights of all vertices over faces are quarters of their areas, those of edges the quarters of two. */
  GOOD(impinge_near_stencils_by_area(near_pairs, scene, &rest, &of));
  GOOD(impinge_stencils_column(of, IMPINGE_COLUMN_WEIGHT, &weights));
  CHECK(weights.rows == n);
  for (i = 0; i < n; ++i) {
    const impinge_pair *row = &impinge_near_data(near_pairs)[i];
    double by_hand = 0;
    if (kind_of(near_pairs, i) != IMPINGE_VF) continue;
    for (j = 0; j < FACES; ++j)
      for (k = 0; k < 3; ++k)
        if (balls[row->body_a].faces[j][k] == row->element_a) by_hand += area_of(&balls[row->body_a], j) / 12;
    CHECK(fabs(((const double *)weights.data)[i] - by_hand) < 1e-15 && by_hand > 0);
  }
  impinge_stencils_destroy(of);
  REFUSED(impinge_near_stencils_by_area(near_pairs, scene, NULL, &of), "rest: NULL");
  CHECK(of == NULL);
  rest.rows -= 1;
  REFUSED(impinge_near_stencils(near_pairs, scene, &rest, &of), "as many as all bodies have vertices");
  GOOD(impinge_project_psd(matrices[0], 2, 3));
  CHECK(matrices[0][0] == 2 && matrices[0][4] == 0 && matrices[0][8] == 0.5 && matrices[1][0] == 0 && matrices[1][8] == 0);
  /* Many at once, which threads share, as each of them. */
  for (i = 0; i < 1000 * 9; ++i) many[i / 9][i % 9] = i % 9 == 4 ? -1 - (double)(i / 9) : i % 9 % 4 == 0 ? 1 : 0.25 * (double)(i % 9 == 1 || i % 9 == 3);
  memcpy(copies, many, sizeof many);
  GOOD(impinge_project_psd(many[0], 1000, 3));
  for (i = 0; i < 1000; ++i) {
    GOOD(impinge_project_psd(copies[i], 1, 3));
    CHECK(memcmp(copies[i], many[i], sizeof many[i]) == 0 && many[i][4] >= 0 && many[i][4] < 0.1);
  }
  GOOD(impinge_project_psd(NULL, 0, 12));
  REFUSED(impinge_project_psd(NULL, 1, 12), "NULL");
  REFUSED(impinge_project_psd(matrices[0], 2, 4), "size: 4 given");
  matrices[1][3] = HUGE_VAL;
  REFUSED(impinge_project_psd(matrices[0], 2, 3), "matrices: inf in row 1, column 0 of matrix 1 given");
  impinge_stencils_destroy(merged);
  impinge_stencils_destroy(plain);
  impinge_near_destroy(near_pairs);
  impinge_scene_destroy(scene);
}

/* Two balls at a distance of 0.9 cross in one circle, and share a lens. */
static void contacts(impinge_detector *detector) {
  impinge_scene *scene = two_balls();
  impinge_pairs *pairs = NULL;
  impinge_contacts *of = NULL;
  impinge_penetration *deep = NULL;
  impinge_array view, lengths;
  impinge_stats stats;
  const impinge_region *region;
  /* Not so that edges meet edges, where the volume would be unknown. */
  static ball beside;
  size_t i;
  beside = balls[1];
  for (i = 0; i < VERTICES; ++i) {
    beside.positions[i][1] += 0.0123;
    beside.positions[i][2] += 0.0234;
  }
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&beside)));
  GOOD(impinge_detect(detector, scene, NULL, &pairs));
  GOOD(impinge_find_contacts(detector, scene, pairs, &of));
  CHECK(impinge_contacts_count(of) == impinge_pairs_count(pairs) && impinge_contacts_hash(of) == impinge_pairs_hash(pairs));
  CHECK(memcmp(impinge_contacts_data(of), impinge_pairs_data(pairs), impinge_pairs_count(pairs) * sizeof(impinge_pair)) == 0);
  impinge_pairs_destroy(pairs);
  GOOD(impinge_contacts_column(of, IMPINGE_COLUMN_CURVE_STARTS, &view));
  CHECK(view.rows == 2 && view.type == IMPINGE_U64);
  GOOD(impinge_contacts_column(of, IMPINGE_COLUMN_CURVE_CLOSED, &view));
  CHECK(view.rows == 1 && *(const uint8_t *)view.data == 1);
  GOOD(impinge_contacts_column(of, IMPINGE_COLUMN_CURVE_LENGTH, &lengths));
  CHECK(fabs(*(const double *)lengths.data - 2 * 3.14159 * sqrt(1 - 0.45 * 0.45)) < 0.1);
  GOOD(impinge_contacts_column(of, IMPINGE_COLUMN_STARTS, &view));
  CHECK(view.rows == impinge_contacts_count(of) + 1);
  GOOD(impinge_contacts_column(of, IMPINGE_COLUMN_SHAPE, &view));
  CHECK(((const uint8_t *)view.data)[0] == IMPINGE_SHAPE_SEGMENT);
  GOOD(impinge_find_penetration(detector, scene, of, 0, 1, &deep));
  CHECK(impinge_penetration_count(deep) == 1);
  region = impinge_penetration_data(deep);
  CHECK(region && fabs(fabs(region->normal[0]) - 1) < 1e-2 && fabs(region->depth - 1.1) < 0.05 && region->n_inside[0] > 100);
  /* The lens of two balls of radius 1: pi (4 + d) (2 - d)^2 / 12. */
  CHECK(fabs(impinge_penetration_volume(deep) - 3.14159 * 4.9 * 1.1 * 1.1 / 12) < 0.1);
  GOOD(impinge_penetration_column(deep, IMPINGE_COLUMN_INSIDE_A, &view));
  CHECK(view.rows == region->n_inside[0]);
  stats.size = sizeof stats;
  GOOD(impinge_penetration_stats(deep, &stats));
  impinge_penetration_destroy(deep);
  impinge_contacts_destroy(of);
  impinge_scene_destroy(scene);
}

static void other_bodies(impinge_detector *detector) {
  static const float solid[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  static const float hair[2][3] = {{0.2f, 0.2f, -1}, {0.2f, 0.2f, 1}};
  static const double seam[4][3] = {{0, 0, 0}, {1, 0, 0}, {-0.0, 0, 0}, {1, 0, 1}};
  static const uint32_t tetrahedron[4] = {0, 1, 2, 3}, edge[2] = {0, 1};
  uint32_t map[4] = {9, 9, 9, 9}, firsts[4] = {9, 9, 9, 9};
  size_t n = 0;
  impinge_scene *scene = NULL;
  impinge_query query;
  impinge_array view;
  int32_t any = -1;
  GOOD(impinge_scene_create(&scene));
  GOOD(impinge_scene_add_tetrahedra(scene, packed(tetrahedron, 1, IMPINGE_U32), packed(solid, 4, IMPINGE_F32), NULL));
  GOOD(impinge_scene_add_edges(scene, packed(edge, 1, IMPINGE_U32), packed(hair, 2, IMPINGE_F32), NULL));
  GOOD(impinge_scene_add_points(scene, packed(hair[1], 1, IMPINGE_F32), NULL));
  GOOD(impinge_scene_faces(scene, 0, &view));
  CHECK(view.rows == 4);
  impinge_query_default(&query);
  query.a = 0;
  query.b = 1;
  GOOD(impinge_any(detector, scene, &query, &any));
  CHECK(any == 1);
  query.b = 2;
  GOOD(impinge_any(detector, scene, &query, &any));
  CHECK(any == 0);
  impinge_scene_destroy(scene);
  GOOD(impinge_weld(packed(seam, 4, IMPINGE_F64), map, firsts, &n));
  CHECK(n == 3 && map[0] == 0 && map[1] == 1 && map[2] == 0 && map[3] == 2 && firsts[2] == 3);
}

/* Each vertex stops for itself; bounds and lists about the same pair of balls, 0.1 apart at first. */
static void solvers(impinge_detector *detector) {
  static ball far_away;
  impinge_scene *scene = two_balls(), *other_scene = two_balls();
  impinge_query query;
  impinge_safe_distances *safe = NULL, *moving = NULL;
  impinge_neighbours *lists = NULL;
  impinge_near *near_pairs = NULL, *again = NULL;
  impinge_motion *motion = NULL;
  impinge_candidates *candidates = NULL;
  impinge_nearest nearest;
  impinge_impact impact;
  impinge_array view, indices, distances;
  impinge_stats stats;
  impinge_exclusion exclusion;
  static uint32_t halves[VERTICES];
  static uint8_t pinned[VERTICES];
  const impinge_near *rest[1];
  uint32_t fixed = 0, first[3] = {9, 9, 9};
  size_t i;
  int32_t found = -1, is_free = -1;
  double least = 9, least_moving = 9;
  make_ball(&far_away, 2.1);
  GOOD(impinge_scene_set_positions(scene, 1, positions_of(&far_away)));
  REFUSED(impinge_find_nearest(detector, scene, NULL, &nearest, &found), "self-collision");
  impinge_query_default(&query);
  query.self = 0;
  GOOD(impinge_find_nearest(detector, scene, &query, &nearest, &found));
  CHECK(found == 1 && fabs(nearest.distance - 0.1) < 0.01 && nearest.body_a == 0 && nearest.body_b == 1);
  /* Half of the distance each; all of it where the other ball does not move. */
  GOOD(impinge_find_safe_distances(detector, scene, 0.5, &query, &safe));
  query.fixed = &fixed;
  query.n_fixed = 1;
  GOOD(impinge_find_safe_distances(detector, scene, 0.5, &query, &moving));
  GOOD(impinge_safe_distances_of(safe, 0, &view));
  CHECK(view.rows == VERTICES && view.type == IMPINGE_F64);
  for (i = 0; i < view.rows; ++i) least = fmin(least, ((const double *)view.data)[i]);
  GOOD(impinge_safe_distances_of(moving, 0, &view));
  for (i = 0; i < view.rows; ++i) CHECK(((const double *)view.data)[i] == 0);
  GOOD(impinge_safe_distances_of(moving, 1, &view));
  for (i = 0; i < view.rows; ++i) least_moving = fmin(least_moving, ((const double *)view.data)[i]);
  CHECK(2 * least < nearest.distance && 2 * least > 0.999 * nearest.distance);
  CHECK(least_moving < nearest.distance && least_moving > 0.999 * nearest.distance);
  CHECK(impinge_near_count(impinge_safe_distances_touching(safe)) == 0);
  stats.size = sizeof stats;
  GOOD(impinge_safe_distances_stats(safe, &stats));
  CHECK(stats.n_candidates > 0);
  REFUSED(impinge_safe_distances_of(safe, 2, &view), "no body 2 among the 2");
  impinge_safe_distances_destroy(moving);
  impinge_safe_distances_destroy(safe);
  /* Lists have the near pairs. */
  query.kinds = IMPINGE_VF;
  query.flags = IMPINGE_DISTANCES;
  GOOD(impinge_find_near(detector, scene, 0.2, &query, &near_pairs));
  GOOD(impinge_find_neighbours(detector, scene, 0.2, &query, &lists));
  CHECK(impinge_neighbours_count(lists) == impinge_near_count(near_pairs) && impinge_near_count(near_pairs) > 10);
  GOOD(impinge_neighbours_first(lists, 1, &first));
  CHECK(first[0] == VERTICES && first[1] == FACES * 3 / 2 && first[2] == FACES);
  GOOD(impinge_neighbours_lists(lists, IMPINGE_VF, 0, &view, &indices, &distances));
  CHECK(view.rows == 2 * VERTICES + 1 && indices.rows == impinge_near_count(near_pairs) && distances.rows == indices.rows);
  {
    const impinge_pair *row = impinge_near_data(near_pairs);
    const uint64_t *offsets = view.data;
    uint32_t vertex = row->body_a * VERTICES + row->element_a, face = row->body_b * FACES + row->element_b;
    CHECK(offsets[vertex] == 0 && offsets[vertex + 1] > 0 && ((const uint32_t *)indices.data)[0] == face);
  }
  {
    size_t i, n = distances.rows;
    float *singles = malloc((n + 1) * sizeof *singles);
    const double *doubles = distances.data;
    char needed[64];
    singles[n] = 7;
    sprintf(needed, "distances: room for %u numbers given, %u needed", (unsigned)(n - 1), (unsigned)n);
    singles[0] = 7;
    REFUSED(impinge_neighbours_distances_f32(lists, IMPINGE_VF, 0, singles, n - 1), needed);
    CHECK(singles[0] == 7);
    REFUSED(impinge_neighbours_distances_f32(lists, IMPINGE_VF, 0, NULL, n), "distances is NULL");
    REFUSED(impinge_neighbours_distances_f32(lists, IMPINGE_VF, 2, singles, n), "reversed: 2");
    GOOD(impinge_neighbours_distances_f32(lists, IMPINGE_VF, 0, singles, n));
    for (i = 0; i < n; i++)
      CHECK((double)singles[i] <= doubles[i] && doubles[i] - (double)singles[i] <= doubles[i] / 4194304);
    CHECK(singles[n] == 7);
    GOOD(impinge_neighbours_distances_f32(lists, IMPINGE_EV, 0, NULL, 0));
    free(singles);
  }
  GOOD(impinge_neighbours_lists(lists, IMPINGE_VF, 1, &view, NULL, NULL));
  CHECK(view.rows == 2 * FACES + 1);
  REFUSED(impinge_neighbours_lists(lists, 3, 0, &view, NULL, NULL), "kind: 3");
  REFUSED(impinge_neighbours_lists(lists, IMPINGE_VF, 2, &view, NULL, NULL), "reversed: 2");
  REFUSED(impinge_neighbours_first(lists, 7, &first), "no body 7");
  GOOD(impinge_neighbours_stats(lists, &stats));
  impinge_neighbours_destroy(lists);
  /* Those that are near at rest are left out; so are groups, and what is pinned on both sides. */
  rest[0] = near_pairs;
  query.rest_pairs = rest;
  query.n_rest_pairs = 1;
  GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
  CHECK(impinge_near_count(again) == 0);
  impinge_near_destroy(again);
  REFUSED(impinge_find_near(detector, other_scene, 0.2, &query, &again), "another scene's");
  query.n_rest_pairs = 0;
  memset(&exclusion, 0, sizeof exclusion);
  exclusion.kind = IMPINGE_EXCLUDE_GROUPS;
  exclusion.b = 1;
  query.exclusions = &exclusion;
  query.n_exclusions = 1;
  for (i = 0; i < VERTICES; ++i) halves[i] = 0;
  GOOD(impinge_scene_set_groups(scene, 0, packed(halves, VERTICES, IMPINGE_U32)));
  for (i = 0; i < VERTICES; ++i) halves[i] = far_away.positions[i][2] > 0;
  GOOD(impinge_scene_set_groups(scene, 1, packed(halves, VERTICES, IMPINGE_U32)));
  GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
  CHECK(impinge_near_count(again) > 0 && impinge_near_count(again) < impinge_near_count(near_pairs));
  impinge_near_destroy(again);
  query.n_exclusions = 0;
  memset(pinned, 1, sizeof pinned);
  GOOD(impinge_scene_set_pinned(scene, 0, packed(pinned, VERTICES, IMPINGE_U8)));
  GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
  CHECK(impinge_near_hash(again) == impinge_near_hash(near_pairs));
  impinge_near_destroy(again);
  GOOD(impinge_scene_set_pinned(scene, 1, packed(pinned, VERTICES, IMPINGE_U8)));
  GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
  CHECK(impinge_near_count(again) == 0);
  impinge_near_destroy(again);
  memset(pinned, 0, sizeof pinned);
  GOOD(impinge_scene_set_pinned(scene, 0, packed(pinned, VERTICES, IMPINGE_U8)));
  GOOD(impinge_scene_set_pinned(scene, 1, packed(pinned, VERTICES, IMPINGE_U8)));
  /* In the surface of one ball all that is near is near. */
  exclusion.kind = IMPINGE_EXCLUDE_RINGS;
  exclusion.b = 0;
  exclusion.n = 3;
  query.n_exclusions = 1;
  query.self = 1;
  query.between = 0;
  GOOD(impinge_find_near(detector, scene, 0.02, &query, &again));
  CHECK(impinge_near_count(again) == 0);
  impinge_near_destroy(again);
  query.n_exclusions = 0;
  GOOD(impinge_find_near(detector, scene, 0.02, &query, &again));
  CHECK(impinge_near_count(again) > 0);
  impinge_near_destroy(again);
  /* The first vertex that is near the other ball is listed with all vertices of that. */
  {
    static uint64_t offsets[VERTICES + 1];
    static uint32_t listed[VERTICES];
    uint32_t vertex;
    GOOD(impinge_near_column(near_pairs, IMPINGE_COLUMN_ROWS, &view));
    vertex = ((const uint32_t *)view.data)[1];
    CHECK(((const uint32_t *)view.data)[0] == 0 && vertex < VERTICES);
    for (i = 0; i <= VERTICES; ++i) offsets[i] = i > vertex ? VERTICES : 0;
    for (i = 0; i < VERTICES; ++i) listed[i] = (uint32_t)i;
    query.self = 0;
    query.between = 1;
    memset(&exclusion, 0, sizeof exclusion);
    exclusion.kind = IMPINGE_EXCLUDE_VERTICES;
    exclusion.b = 1;
    exclusion.offsets = packed(offsets, VERTICES + 1, IMPINGE_U64);
    exclusion.vertices = packed(listed, VERTICES, IMPINGE_U32);
    query.n_exclusions = 1;
    GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
    CHECK(impinge_near_count(again) < impinge_near_count(near_pairs) && impinge_near_count(again) > 0);
    impinge_near_destroy(again);
    exclusion.offsets.rows = VERTICES;
    REFUSED(impinge_find_near(detector, scene, 0.2, &query, &again), "1154 offsets, but body 0 has 1154 vertices");
    query.n_exclusions = 0;
  }
  /* One thickness per vertex is that of all, if all are the same. */
  {
    static double thick[VERTICES];
    size_t n_one;
    GOOD(impinge_scene_set_thickness(scene, 0, 0.05));
    GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
    n_one = impinge_near_count(again);
    CHECK(n_one > impinge_near_count(near_pairs));
    impinge_near_destroy(again);
    for (i = 0; i < VERTICES; ++i) thick[i] = 0.05;
    GOOD(impinge_scene_set_element_thickness(scene, 0, IMPINGE_POINTS, packed(thick, VERTICES, IMPINGE_F64)));
    GOOD(impinge_find_near(detector, scene, 0.2, &query, &again));
    CHECK(impinge_near_count(again) == n_one);
    impinge_near_destroy(again);
    REFUSED(impinge_scene_set_element_thickness(scene, 0, IMPINGE_EDGES, packed(thick, VERTICES, IMPINGE_F64)), "thicknesses given");
    REFUSED(impinge_scene_set_element_thickness(scene, 0, IMPINGE_TETRAHEDRA, packed(thick, VERTICES, IMPINGE_F64)), "kind: 4 given");
    thick[7] = -1;
    REFUSED(impinge_scene_set_element_thickness(scene, 0, IMPINGE_POINTS, packed(thick, VERTICES, IMPINGE_F64)), "a thickness of -1 is given as number 7");
    GOOD(impinge_scene_set_thickness(scene, 0, 0));
  }
  impinge_near_destroy(near_pairs);
  /* The second ball wants into the first: its far side comes all the way. */
  GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(&balls[1])));
  GOOD(impinge_truncate(detector, scene, NULL, &motion));
  CHECK(impinge_motion_n_cut(motion) > 10 && impinge_motion_n_touching(motion) == 0 && impinge_motion_rounds(motion) > 0);
  CHECK(isnan(impinge_motion_fraction(motion)) && impinge_motion_start_intersects(motion) == -1);
  REFUSED(impinge_motion_first(motion, &impact, &found), "impinge_truncate");
  GOOD(impinge_motion_pairs(motion, &candidates));
  {
    /* Only the second ball moves. */
    const impinge_pair *rows = impinge_candidates_data(candidates);
    CHECK(impinge_candidates_count(candidates) > 10 && impinge_candidates_hash(candidates) != 0);
    for (i = 0; i < impinge_candidates_count(candidates); ++i) CHECK(rows[i].body_a == 1 || rows[i].body_b == 1);
    impinge_candidates_destroy(candidates);
  }
  GOOD(impinge_motion_positions(motion, 1, &view));
  {
    const double(*at)[3] = view.data;
    size_t n_there = 0;
    for (i = 0; i < VERTICES; ++i) n_there += memcmp(at[i], balls[1].positions[i], sizeof at[i]) == 0;
    CHECK(n_there == VERTICES - impinge_motion_n_cut(motion) && n_there > 10);
    GOOD(impinge_scene_set_end_positions(scene, 1, view));
  }
  GOOD(impinge_is_free(detector, scene, NULL, &is_free));
  CHECK(is_free == 1);
  GOOD(impinge_motion_apply(motion, scene));
  CHECK(hash_of(detector, scene, NULL) == 0);
  impinge_motion_destroy(motion);
  impinge_scene_destroy(other_scene);
  impinge_scene_destroy(scene);
}

/* Points and rays at a ball of radius 1. */
static void probes(impinge_detector *detector) {
  static const float points[4][3] = {{0, 0, 0}, {0, 0, 1}, {3, 0, 0}, {0, 0, -1.5f}};
  static const double origins[2][3] = {{0, 0, 5}, {0, 3, 5}};
  static const float down[2][3] = {{0, 0, -2}, {0, 0, -2}};
  impinge_scene *scene = NULL;
  impinge_closest *closest = NULL;
  impinge_hits *hits = NULL;
  impinge_query query;
  impinge_array at = packed(points, 4, IMPINGE_F32), from = packed(origins, 2, IMPINGE_F64), to = packed(down, 2, IMPINGE_F32), view;
  impinge_stats stats;
  const impinge_closest_element *near_to;
  const impinge_ray_hit *hit;
  int8_t places[4] = {9, 9, 9, 9};
  double signed_[4] = {9, 9, 9, 9};
  uint64_t hash;
  GOOD(impinge_scene_create(&scene));
  GOOD(impinge_scene_add_triangles(scene, faces_of(&balls[0]), positions_of(&balls[0]), NULL));
  GOOD(impinge_contains(detector, scene, 0, at, places));
  CHECK(places[0] == 1 && places[1] == 0 && places[2] == -1 && places[3] == -1);
  GOOD(impinge_signed_distance(detector, scene, 0, at, signed_));
  CHECK(fabs(signed_[0] - 1) < 0.01 && signed_[1] == 0 && fabs(signed_[2] + 2) < 0.01 && signed_[3] == -0.5);
  GOOD(impinge_contains(detector, scene, 0, packed(NULL, 0, IMPINGE_F32), NULL));
  GOOD(impinge_find_closest(detector, scene, at, 1.75, NULL, &closest));
  CHECK(impinge_closest_count(closest) == 4 && impinge_closest_hash(closest) != 0);
  near_to = impinge_closest_data(closest);
  CHECK(near_to[0].found == 1 && near_to[0].distance == fabs(signed_[0]) && near_to[0].body == 0);
  CHECK(near_to[2].found == 0 && near_to[2].body == IMPINGE_ANY_BODY && near_to[2].feature == IMPINGE_NO_FEATURE);
  CHECK(isinf(near_to[2].distance) && isnan(near_to[2].point[0]));
  /* The pole is a vertex of its faces. */
  CHECK(near_to[3].distance == 0.5 && near_to[3].point[2] == -1 && near_to[3].feature < 3);
  CHECK(balls[0].faces[near_to[3].element][near_to[3].feature] == RINGS * SEGMENTS + 1);
  GOOD(impinge_closest_column(closest, IMPINGE_COLUMN_DISTANCE, &view));
  CHECK(view.rows == 4 && view.data == &near_to[0].distance && view.row_stride == (ptrdiff_t)sizeof *near_to);
  GOOD(impinge_closest_column(closest, IMPINGE_COLUMN_POINTS, &view));
  CHECK(view.data == near_to[0].point);
  GOOD(impinge_closest_column(closest, IMPINGE_COLUMN_ROWS, &view));
  CHECK(view.data == &near_to[0].body);
  GOOD(impinge_closest_column(closest, IMPINGE_COLUMN_FEATURES, &view));
  REFUSED(impinge_closest_column(closest, IMPINGE_COLUMN_T, &view), "no column");
  stats.size = sizeof stats;
  GOOD(impinge_closest_stats(closest, &stats));
  impinge_closest_destroy(closest);
  /* Three faces of each point: those around the poles touch there, and the lowest is first. */
  impinge_query_default(&query);
  query.n_nearest = 3;
  GOOD(impinge_find_closest(detector, scene, at, 1.75, &query, &closest));
  CHECK(impinge_closest_count(closest) == 12 && impinge_closest_n_nearest(closest) == 3);
  near_to = impinge_closest_data(closest);
  CHECK(near_to[3].distance == 0 && near_to[5].distance == 0 && near_to[3].element < near_to[4].element);
  CHECK(near_to[4].element < near_to[5].element && near_to[6].found == 0 && near_to[8].element == IMPINGE_NO_ELEMENT);
  CHECK(near_to[9].distance == 0.5 && near_to[11].distance == 0.5 && near_to[9].element < near_to[10].element);
  GOOD(impinge_closest_column(closest, IMPINGE_COLUMN_POINTS, &view));
  CHECK(view.rows == 12);
  impinge_closest_destroy(closest);
  {
    /* Two tetrahedra that share a face. The points: in the second, on that face, outside. */
    static const double corners[5][3] = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}, {0, 0, -4}};
    static const uint32_t cells[2][4] = {{0, 1, 2, 3}, {0, 2, 1, 4}};
    static const float where[3][3] = {{1, 1, -1}, {1, 1, 0}, {3, 3, 3}};
    uint32_t tetrahedra[3] = {9, 9, 9}, body = 9;
    GOOD(impinge_scene_add_tetrahedra(scene, packed(cells, 2, IMPINGE_U32), packed(corners, 5, IMPINGE_F64), &body));
    GOOD(impinge_locate(detector, scene, body, packed(where, 3, IMPINGE_F32), tetrahedra));
    CHECK(tetrahedra[0] == 1 && tetrahedra[1] == 0 && tetrahedra[2] == IMPINGE_NO_ELEMENT);
    GOOD(impinge_scene_remove(scene, body));
  }
  {
    /* Two surfaces as one: in both, in one, on one, outside. */
    static const double corners[8][3] = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}, {-1, -1, -1}, {15, -1, -1}, {-1, 15, -1}, {-1, -1, 15}};
    static const uint32_t shells[8][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {4, 6, 5}, {4, 5, 7}, {5, 6, 7}, {6, 4, 7}};
    static const float where[4][3] = {{1, 1, 1}, {3, 3, 3}, {0, 1, 1}, {-2, 0, 0}};
    int32_t windings[4] = {9, 9, 9, 9};
    uint32_t body = 9;
    GOOD(impinge_scene_add_triangles(scene, packed(shells, 8, IMPINGE_U32), packed(corners, 8, IMPINGE_F64), &body));
    GOOD(impinge_winding_numbers(detector, scene, body, packed(where, 4, IMPINGE_F32), windings));
    CHECK(windings[0] == 2 && windings[1] == 1 && windings[2] == IMPINGE_ON_SURFACE && windings[3] == 0);
    GOOD(impinge_scene_remove(scene, body));
  }
  /* One ray down the axis, one beside the ball: origins in double precision, directions in single. */
  GOOD(impinge_cast(detector, scene, from, to, HUGE_VAL, NULL, &hits));
  CHECK(impinge_hits_n_rays(hits) == 2 && impinge_hits_count(hits) == 1);
  hit = impinge_hits_data(hits);
  CHECK(hit->t == 2 && hit->ray == 0 && hit->feature < 3 && hit->barycentrics[hit->feature] == 1);
  GOOD(impinge_hits_column(hits, IMPINGE_COLUMN_IS_HIT, &view));
  CHECK(view.rows == 2 && ((const uint8_t *)view.data)[0] == 1 && ((const uint8_t *)view.data)[1] == 0);
  GOOD(impinge_hits_column(hits, IMPINGE_COLUMN_T, &view));
  CHECK(*(const double *)view.data == 2);
  hash = impinge_hits_hash(hits);
  impinge_hits_destroy(hits);
  impinge_query_default(&query);
  query.hits = IMPINGE_HITS_ALL;
  GOOD(impinge_cast(detector, scene, from, to, HUGE_VAL, &query, &hits));
  /* All faces at both poles. */
  CHECK(impinge_hits_count(hits) == 2 * SEGMENTS && impinge_hits_hash(hits) != hash);
  CHECK(impinge_hits_data(hits)[2 * SEGMENTS - 1].t == 3);
  GOOD(impinge_hits_column(hits, IMPINGE_COLUMN_STARTS, &view));
  CHECK(view.rows == 3 && ((const uint64_t *)view.data)[1] == 2 * SEGMENTS && ((const uint64_t *)view.data)[2] == 2 * SEGMENTS);
  impinge_hits_destroy(hits);
  query.hits = IMPINGE_HITS_ANY;
  GOOD(impinge_cast(detector, scene, from, to, 1, &query, &hits));
  GOOD(impinge_hits_column(hits, IMPINGE_COLUMN_IS_HIT, &view));
  CHECK(impinge_hits_count(hits) == 0 && ((const uint8_t *)view.data)[0] == 0);
  REFUSED(impinge_hits_column(hits, IMPINGE_COLUMN_STARTS, &view), "did not ask");
  GOOD(impinge_hits_stats(hits, &stats));
  impinge_hits_destroy(hits);
  impinge_scene_destroy(scene);
}

static void gpus(void) {
  impinge_devices *devices = NULL;
  size_t i;
  GOOD(impinge_find_devices(&devices));
#ifndef WITH_GPU
  CHECK(impinge_devices_count(devices) == 0 && impinge_devices_data(devices) == NULL);
#endif
  for (i = 0; i < impinge_devices_count(devices); ++i) {
    const impinge_device *of = &impinge_devices_data(devices)[i];
    CHECK(strlen(of->name) > 0 && strlen(of->interface_name) > 0 && of->driver != NULL && of->max_binding > 0 && of->is_software < 2);
  }
  impinge_devices_destroy(devices);
}

static int n_progress = 0, n_logged = 0;
static int cancel(void *user) { return *(int *)user; }
static void progress(void *user, uint64_t done, uint64_t total) {
  (void)user;
  CHECK(done <= total);
  ++n_progress;
}
static void logged(void *user, uint32_t level, const char *message) {
  (void)user;
  n_logged += level == IMPINGE_LOG_ERROR && strlen(message) > 0;
}

static void callbacks(void) {
  int stop = 0;
  impinge_settings settings;
  impinge_detector *detector = NULL;
  impinge_scene *scene = two_balls();
  impinge_pairs *pairs = (impinge_pairs *)scene;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.cancelled = cancel;
  settings.progress = progress;
  settings.log = logged;
  settings.user = &stop;
  settings.max_pairs = 10;
  GOOD(impinge_detector_create(&settings, &detector));
  CHECK(impinge_detect(detector, scene, NULL, &pairs) == IMPINGE_ERROR_TOO_MANY_PAIRS && pairs == NULL);
  CHECK(n_progress > 0 && n_logged == 1);
  stop = 1;
  CHECK(impinge_detect(detector, scene, NULL, &pairs) == IMPINGE_ERROR_CANCELLED && n_logged == 2);
  stop = 0;
  CHECK(impinge_detect(detector, scene, NULL, &pairs) == IMPINGE_ERROR_TOO_MANY_PAIRS);
  impinge_detector_destroy(detector);
  settings.max_pairs = 0;
  settings.memory_budget = 1000;
  GOOD(impinge_detector_create(&settings, &detector));
  CHECK(impinge_detect(detector, scene, NULL, &pairs) == IMPINGE_ERROR_BUDGET);
  impinge_detector_destroy(detector);
  impinge_scene_destroy(scene);
}

/* A detector that is asked by its own callback refuses, and goes on with the first question. */
typedef struct {
  impinge_detector *detector;
  const impinge_scene *scene;
  int n_refused;
} asked_again;
static int ask_again(void *user) {
  asked_again *of = (asked_again *)user;
  impinge_pairs *pairs = (impinge_pairs *)of;
  int32_t any = -1;
  REFUSED(impinge_any(of->detector, of->scene, NULL, &any), "the detector is in use: a detector answers one question at a time");
  REFUSED(impinge_detect(of->detector, of->scene, NULL, &pairs), "the detector is in use");
  CHECK(any == -1 && pairs == NULL && n_logged == 0);
  ++of->n_refused;
  return 0;
}
static void in_use(void) {
  asked_again user = {NULL, NULL, 0};
  impinge_settings settings;
  impinge_scene *scene = two_balls();
  int32_t any = 0;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.cancelled = ask_again;
  settings.log = logged;
  settings.user = &user;
  n_logged = 0;
  GOOD(impinge_detector_create(&settings, &user.detector));
  user.scene = scene;
  GOOD(impinge_any(user.detector, scene, NULL, &any));
  CHECK(any == 1 && user.n_refused > 0);
  GOOD(impinge_any(user.detector, scene, NULL, &any));
  impinge_detector_destroy(user.detector);
  impinge_scene_destroy(scene);
}

/* Callbacks of a question that change its scene, or end what it uses, are refused. They may read the scene, and ask another detector. */
enum { BY_CANCELLED, BY_PROGRESS, BY_LOG, BY_RUN, BY_PASSES, CALLBACKS };
typedef struct {
  impinge_detector *detector, *other;
  impinge_scene *scene;
  impinge_near *near_pairs;
  impinge_motion *motion;
  uint64_t hash;
  int n_refused[CALLBACKS];
} changed_by;
static void change_scene(changed_by *of, int by) {
  static const char *const in_use_by_question = "the scene is in use: another call is reading it";
  const impinge_array at = positions_of(&balls[0]);
  impinge_array view;
  impinge_stencils *stencils_of = NULL;
  impinge_stats stats;
  if (of->n_refused[by]++ > 0) return;
  REFUSED(impinge_scene_remove(of->scene, 1), in_use_by_question);
  REFUSED(impinge_scene_set_positions(of->scene, 1, at), in_use_by_question);
  REFUSED(impinge_scene_lend_positions(of->scene, 1, at, NULL, NULL), in_use_by_question);
  REFUSED(impinge_scene_add_points(of->scene, at, NULL), in_use_by_question);
  REFUSED(impinge_motion_apply(of->motion, of->scene), in_use_by_question);
  impinge_scene_destroy(of->scene);
  CHECK(strstr(impinge_error_message(), "the scene is in use") && strstr(impinge_error_message(), "it is not destroyed"));
  impinge_detector_destroy(of->detector);
  CHECK(strstr(impinge_error_message(), "the detector is in use") && strstr(impinge_error_message(), "it is not destroyed"));
  memset(&stats, 0, sizeof stats);
  stats.size = sizeof stats;
  REFUSED(impinge_detector_stats(of->detector, &stats), "the detector is in use");
  CHECK(stats.total_ms == 0 && impinge_detector_start_intersects(of->detector) == -1);
  CHECK(impinge_scene_n_bodies(of->scene) == 2);
  GOOD(impinge_scene_positions(of->scene, 1, &view));
  CHECK(view.rows == VERTICES);
  GOOD(impinge_near_stencils(of->near_pairs, of->scene, NULL, &stencils_of));
  impinge_stencils_destroy(stencils_of);
  CHECK(hash_of(of->other, of->scene, NULL) == of->hash);
}
static int change_by_cancelled(void *user) {
  change_scene((changed_by *)user, BY_CANCELLED);
  return 0;
}
static void change_by_progress(void *user, uint64_t done, uint64_t total) {
  (void)done, (void)total;
  change_scene((changed_by *)user, BY_PROGRESS);
}
static void change_by_log(void *user, uint32_t level, const char *message) {
  if (level != IMPINGE_LOG_ERROR) return;
  change_scene((changed_by *)user, BY_LOG);
  CHECK(strstr(message, "distance: -1 given") != NULL);
}
static int change_by_run(void *user, uint32_t kind, const impinge_pair *rows, size_t n) {
  (void)kind, (void)rows, (void)n;
  change_scene((changed_by *)user, BY_RUN);
  return 0;
}
static int change_by_passes(void *user, const impinge_element *a, const impinge_element *b) {
  change_scene((changed_by *)user, BY_PASSES);
  return a->body != b->body;
}
static void changes_by_callbacks(void) {
  static ball end;
  changed_by user;
  impinge_settings settings;
  impinge_query query;
  impinge_step step;
  impinge_near *none = NULL;
  impinge_impacts *impacts = NULL, *expected = NULL;
  impinge_candidates *candidates = NULL;
  uint64_t n = 0;
  int by;
  memset(&user, 0, sizeof user);
  user.scene = two_balls();
  user.other = open_detector(1);
  user.hash = hash_of(user.other, user.scene, NULL);
  impinge_query_default(&query);
  query.kinds = IMPINGE_VF | IMPINGE_EE;
  GOOD(impinge_find_near(user.other, user.scene, 0.01, &query, &user.near_pairs));
  make_ball(&end, 0.89);
  GOOD(impinge_scene_set_end_positions(user.scene, 1, positions_of(&end)));
  impinge_query_default(&step);
  step.self = 0;
  GOOD(impinge_find_impacts(user.other, user.scene, &step, &expected));
  GOOD(impinge_find_candidates(user.other, user.scene, 0.01, &query, &candidates));
  GOOD(impinge_advance(user.other, user.scene, &step, NULL, &user.motion));
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.threads = 1;
  settings.cancelled = change_by_cancelled;
  settings.progress = change_by_progress;
  settings.log = change_by_log;
  settings.user = &user;
  GOOD(impinge_detector_create(&settings, &user.detector));
  CHECK(hash_of(user.detector, user.scene, NULL) == user.hash);
  step.passes = change_by_passes;
  step.passes_user = &user;
  GOOD(impinge_find_impacts(user.detector, user.scene, &step, &impacts));
  CHECK(impinge_impacts_count(impacts) > 0 && impinge_impacts_hash(impacts) == impinge_impacts_hash(expected));
  GOOD(impinge_find_candidates_in_runs(user.detector, user.scene, 0.01, &query, 1000, change_by_run, &user, &n));
  CHECK(n > 1000 && n == impinge_candidates_count(candidates));
  /* The message is that of the question, although calls of its callback have failed since. */
  REFUSED(impinge_find_near(user.detector, user.scene, -1, NULL, &none), "distance: -1 given");
  for (by = 0; by < CALLBACKS; ++by) CHECK(user.n_refused[by] > 0);
  /* Afterwards all is as ever. */
  GOOD(impinge_scene_remove(user.scene, 1));
  CHECK(impinge_scene_n_bodies(user.scene) == 1);
  impinge_impacts_destroy(impacts);
  impinge_impacts_destroy(expected);
  impinge_candidates_destroy(candidates);
  impinge_motion_destroy(user.motion);
  impinge_near_destroy(user.near_pairs);
  impinge_detector_destroy(user.detector);
  impinge_detector_destroy(user.other);
  impinge_scene_destroy(user.scene);
}

#ifdef TEST_PANIC
impinge_status impinge_test_panic(impinge_detector *detector);
impinge_status impinge_test_scene_panic(impinge_scene *scene);
impinge_status impinge_test_helper_panic(impinge_detector *detector, const impinge_scene *scene);
#define BROKEN(call, text)                                                                                              \
  do {                                                                                                                  \
    CHECK((call) == IMPINGE_ERROR_INTERNAL);                                                                            \
    CHECK(strstr(impinge_error_message(), (text " is broken")) != NULL);                                                \
  } while (0)
/* A broken detector refuses everything but its end, and logs that it does. */
static void broken_detector(void) {
  impinge_settings settings;
  impinge_detector *detector = NULL;
  impinge_scene *scene = two_balls();
  impinge_stats stats;
  int32_t any = -1;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.log = logged;
  GOOD(impinge_detector_create(&settings, &detector));
  GOOD(impinge_any(detector, scene, NULL, &any));
  n_logged = 0;
  CHECK(impinge_test_panic(detector) == IMPINGE_ERROR_INTERNAL && n_logged == 1);
  BROKEN(impinge_any(detector, scene, NULL, &any), "the detector");
  CHECK(n_logged == 2);
  memset(&stats, 0, sizeof stats);
  stats.size = sizeof stats;
  BROKEN(impinge_detector_stats(detector, &stats), "the detector");
  CHECK(stats.total_ms == 0 && impinge_detector_start_intersects(detector) == -1);
  impinge_detector_destroy(detector);
  impinge_scene_destroy(scene);
}
/* A broken scene refuses everything but its end. A detector that is asked about it stays sound. */
static void broken_scene(void) {
  impinge_detector *detector = open_detector(1);
  impinge_scene *good = two_balls(), *bad = two_balls();
  impinge_near *near_pairs = NULL;
  impinge_stencils *found = NULL;
  impinge_array view;
  impinge_query query;
  int32_t any = -1;
  impinge_query_default(&query);
  query.kinds = IMPINGE_VF | IMPINGE_EE;
  GOOD(impinge_find_near(detector, bad, 0.01, &query, &near_pairs));
  CHECK(impinge_test_scene_panic(bad) == IMPINGE_ERROR_INTERNAL && strstr(impinge_error_message(), "as a test asked"));
  BROKEN(impinge_any(detector, bad, NULL, &any), "the scene");
  CHECK(any == -1);
  BROKEN(impinge_near_stencils(near_pairs, bad, NULL, &found), "the scene");
  BROKEN(impinge_near_stencils_by_area(near_pairs, bad, NULL, &found), "the scene");
  CHECK(found == NULL);
  BROKEN(impinge_scene_positions(bad, 0, &view), "the scene");
  BROKEN(impinge_scene_remove(bad, 0), "the scene");
  CHECK(impinge_scene_n_bodies(bad) == 0);
  GOOD(impinge_any(detector, good, NULL, &any));
  CHECK(any == 1);
  impinge_near_destroy(near_pairs);
  impinge_detector_destroy(detector);
  impinge_scene_destroy(bad);
  impinge_scene_destroy(good);
}
/* A panic of a helper thread prints nothing, and the message says where it was. */
static void helper_panics(void) {
  static ball end;
  impinge_detector *detector = open_detector(2);
  impinge_scene *scene = two_balls();
  FILE *printed = tmpfile();
  const int kept = dup(fileno(stderr));
  impinge_status status;
  long n_printed;
  make_ball(&end, 0.5);
  GOOD(impinge_scene_set_end_positions(scene, 1, positions_of(&end)));
  fflush(stderr);
  dup2(fileno(printed), fileno(stderr));
  status = impinge_test_helper_panic(detector, scene);
  fflush(stderr);
  dup2(kept, fileno(stderr));
  close(kept);
  fseek(printed, 0, SEEK_END);
  n_printed = ftell(printed);
  fclose(printed);
  CHECK(n_printed == 0);
  CHECK(status == IMPINGE_ERROR_INTERNAL && strstr(impinge_error_message(), "as a test asked of a helper (") != NULL);
  CHECK(strstr(impinge_error_message(), "detector.rs:") != NULL);
  impinge_detector_destroy(detector);
  impinge_scene_destroy(scene);
}
/* A defect breaks the handle, and nothing else. */
static void panics(void) {
  impinge_detector *detector = open_detector(1), *other = open_detector(1);
  impinge_scene *scene = two_balls();
  int32_t any = -1;
  CHECK(impinge_test_panic(detector) == IMPINGE_ERROR_INTERNAL && strstr(impinge_error_message(), "as a test asked"));
  CHECK(impinge_any(detector, scene, NULL, &any) == IMPINGE_ERROR_INTERNAL && strstr(impinge_error_message(), "broken"));
  CHECK(any == -1);
  impinge_detector_destroy(detector);
  GOOD(impinge_any(other, scene, NULL, &any));
  CHECK(any == 1);
  impinge_detector_destroy(other);
  impinge_scene_destroy(scene);
}
#endif

int main(void) {
  impinge_detector *detector = open_detector(2);
  CHECK(impinge_abi_version() == IMPINGE_ABI_VERSION && strlen(impinge_version()) >= 5);
  make_ball(&balls[0], 0);
  make_ball(&balls[1], 0.9);
  arrays(detector);
  pairs_of_bodies(detector);
  steps(detector);
  near_and_candidates(detector);
  stencils(detector);
  changes(detector);
  contacts(detector);
  solvers(detector);
  probes(detector);
  gpus();
  other_bodies(detector);
  callbacks();
  in_use();
  changes_by_callbacks();
#ifdef TEST_PANIC
  panics();
  helper_panics();
  broken_detector();
  broken_scene();
#endif
  impinge_detector_destroy(detector);
  return finish("questions");
}
