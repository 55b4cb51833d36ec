/* A table of wrong arguments: each is refused with a message that names what is wrong, and changes nothing. */
#include "common.h"

int main(void) {
  static ball one;
  impinge_scene *scene = NULL;
  impinge_detector *detector = open_detector(1);
  impinge_pairs *pairs = (impinge_pairs *)detector;
  impinge_query query;
  impinge_settings settings;
  impinge_detector *refused = detector;
  impinge_exclusion exclusion;
  impinge_array faces, at, bad;
  impinge_impact impact;
  double number = 0;
  int64_t wide[3] = {0, 1, -2};
  impinge_safe_distances *safe = (impinge_safe_distances *)detector;
  impinge_near *near_pairs = NULL, *other_near = NULL;
  impinge_neighbours *lists = NULL;
  impinge_closest *closest = (impinge_closest *)detector;
  impinge_hits *hits = (impinge_hits *)detector;
  impinge_motion *motion = (impinge_motion *)detector;
  impinge_candidates *candidates = NULL;
  impinge_nearest nearest;
  int8_t places[VERTICES];
  uint32_t tetrahedra[VERTICES] = {9};
  int32_t windings[VERTICES] = {9};
  uint32_t fixed = 3, beyond[3] = {0, 1, VERTICES};
  int32_t found = -1;
  uint64_t n = 7;
  size_t size = 0;
  make_ball(&one, 0);
  faces = faces_of(&one);
  at = positions_of(&one);
  GOOD(impinge_scene_create(&scene));
  GOOD(impinge_scene_add_triangles(scene, faces, at, NULL));

  /* NULL. */
  REFUSED(impinge_scene_create(NULL), "scene is NULL");
  REFUSED(impinge_scene_add_triangles(NULL, faces, at, NULL), "scene is NULL");
  REFUSED(impinge_detect(NULL, scene, NULL, &pairs), "detector is NULL");
  CHECK(pairs == NULL);
  REFUSED(impinge_detect(detector, NULL, NULL, &pairs), "scene is NULL");
  REFUSED(impinge_detect(detector, scene, NULL, NULL), "pairs is NULL");
  REFUSED(impinge_count(detector, scene, NULL, NULL), "n is NULL");
  REFUSED(impinge_find_earliest(detector, scene, NULL, &impact, NULL), "found is NULL");
  REFUSED(impinge_advance(detector, scene, NULL, NULL, NULL), "NULL");
  REFUSED(impinge_find_contacts(detector, scene, NULL, (impinge_contacts **)&pairs), "pairs is NULL");
  REFUSED(impinge_find_candidates_in_runs(detector, scene, 0, NULL, 10, NULL, NULL, &n), "each is NULL");
  REFUSED(impinge_pairs_column(NULL, IMPINGE_COLUMN_ROWS, &bad), "pairs is NULL");
  REFUSED(impinge_motion_apply(NULL, scene), "motion is NULL");
  REFUSED(impinge_detector_stats(detector, NULL), "stats is NULL");
  REFUSED(impinge_scene_positions(scene, 0, NULL), "view is NULL");
  REFUSED(impinge_weld(at, NULL, NULL, &size), "map is NULL");
  impinge_scene_destroy(NULL);
  impinge_detector_destroy(NULL);
  impinge_pairs_destroy(NULL);
  impinge_query_default(NULL);
  CHECK(impinge_pairs_count(NULL) == 0 && impinge_pairs_data(NULL) == NULL && impinge_pairs_hash(NULL) == 0);
  CHECK(impinge_scene_n_bodies(NULL) == 0 && impinge_hash_pairs(NULL, 0) == 0);

  /* Arrays. */
  REFUSED(impinge_scene_add_triangles(scene, at, faces, NULL), "IMPINGE_U32, where IMPINGE_F32 or IMPINGE_F64");
  REFUSED(impinge_scene_add_triangles(scene, at, at, NULL), "swapped");
  bad = at;
  bad.data = NULL;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "data is NULL");
  bad.data = (const char *)at.data + 1;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "not aligned");
  bad = at;
  bad.row_stride = 3;
  bad.column_stride = 1;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "strides are in bytes");
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "no multiple of the");
  bad.row_stride = 1;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "rows are not of 3 numbers each (row_stride is 1: strides are in bytes)");
  bad.row_stride = 24;
  bad.column_stride = 0;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "column_stride is 0");
  bad.column_stride = PTRDIFF_MAX - 7;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "more than memory has");
  bad = at;
  bad.type = 99;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "99");
  bad = at;
  --bad.rows;
  REFUSED(impinge_scene_set_positions(scene, 0, bad), "body 0");
  REFUSED(impinge_scene_set_end_positions(scene, 0, bad), "body 0");
  bad = packed(wide, 1, IMPINGE_I64);
  REFUSED(impinge_scene_add_triangles(scene, bad, at, NULL), "row 0 has -2");
  wide[2] = INT64_C(1) << 32;
  REFUSED(impinge_scene_add_triangles(scene, bad, at, NULL), "row 0 has 4294967296");
  bad = packed(beyond, 1, IMPINGE_U32);
  REFUSED(impinge_scene_add_triangles(scene, bad, at, NULL), "element 0 names vertex 1154");
  CHECK(strstr(impinge_error_message(), "body 1") != NULL);
  number = one.positions[7][1];
  one.positions[7][1] = NAN;
  REFUSED(impinge_scene_set_positions(scene, 0, at), "body 0: vertex 7");
  CHECK(strstr(impinge_error_message(), "NaN") != NULL);
  REFUSED(impinge_scene_lend_positions(scene, 0, at, NULL, NULL), "vertex 7");
  one.positions[7][1] = number;
  REFUSED(impinge_scene_remesh(scene, 0, 9, faces, at), "kind: 9");
  REFUSED(impinge_scene_remesh(scene, 0, IMPINGE_POINTS, faces, at), "points have one element per position");
  REFUSED(impinge_scene_set_transform(scene, 0, packed(one.positions, 3, IMPINGE_F64)), "3 rows");
  REFUSED(impinge_scene_set_transform(scene, 0, packed(one.positions, 4, IMPINGE_F64)), "transform");

  /* Bodies and numbers. */
  REFUSED(impinge_scene_set_positions(scene, 1, at), "no body 1 among the 1");
  REFUSED(impinge_scene_set_filter(scene, IMPINGE_ANY_BODY, 1, 1), "no body");
  REFUSED(impinge_scene_set_thickness(scene, 0, -1), "thickness: -1 given");
  REFUSED(impinge_scene_set_thickness(scene, 0, -1e-300), "thickness: -1e-300 given");
  REFUSED(impinge_scene_set_edges(scene, 0, packed(beyond, 1, IMPINGE_U32)), "1 rows of edges given, but there are");
  {
    static const uint32_t twice[2][2] = {{0, 1}, {1, 0}};
    REFUSED(impinge_scene_set_edges(scene, 0, packed(twice, 2, IMPINGE_U32)), "row 1 of edges has vertices 1 and 0, as row 0 has");
  }
  REFUSED(impinge_find_distance(detector, scene, 0, 0, NULL, &found), "body 0");
  REFUSED(impinge_find_distance(detector, scene, 0, 3, NULL, &found), "no body 3");
  REFUSED(impinge_find_near(detector, scene, NAN, NULL, (impinge_near **)&pairs), "distance: NaN");
  REFUSED(impinge_find_candidates(detector, scene, -1, NULL, (impinge_candidates **)&pairs), "inflation: -1");
  CHECK(found == -1);

  /* Points, rays, bounds. */
  REFUSED(impinge_contains(NULL, scene, 0, at, places), "detector is NULL");
  REFUSED(impinge_contains(detector, NULL, 0, at, places), "scene is NULL");
  REFUSED(impinge_contains(detector, scene, 0, at, NULL), "places is NULL");
  REFUSED(impinge_contains(detector, scene, 4, at, places), "no body 4");
  REFUSED(impinge_contains(detector, scene, 0, faces, places), "points: its type is IMPINGE_U32");
  REFUSED(impinge_signed_distance(detector, scene, 0, at, NULL), "distances is NULL");
  {
    uint32_t open = 9;
    GOOD(impinge_scene_add_triangles(scene, packed(one.faces, FACES - 1, IMPINGE_U32), at, &open));
    REFUSED(impinge_contains(detector, scene, open, at, places), "edge");
    CHECK(strstr(impinge_error_message(), "body 1") != NULL);
    GOOD(impinge_scene_remove(scene, open));
  }
  one.positions[7][1] = NAN;
  REFUSED(impinge_find_closest(detector, scene, at, 1, NULL, &closest), "7");
  CHECK(closest == NULL);
  REFUSED(impinge_cast(detector, scene, at, packed(one.faces, 2, IMPINGE_F32), 1, NULL, &hits), "2 directions given");
  CHECK(hits == NULL);
  one.positions[7][1] = number;
  REFUSED(impinge_find_closest(detector, scene, at, -1, NULL, &closest), "most: -1");
  REFUSED(impinge_find_closest(detector, scene, at, 1, NULL, NULL), "closest is NULL");
  impinge_query_default(&query);
  CHECK(query.n_nearest == 1);
  query.n_nearest = 0;
  REFUSED(impinge_find_closest(detector, scene, at, 1, &query, &closest), "n_nearest: 0");
  CHECK(closest == NULL);
  REFUSED(impinge_winding_numbers(NULL, scene, 0, at, windings), "detector is NULL");
  REFUSED(impinge_winding_numbers(detector, NULL, 0, at, windings), "scene is NULL");
  REFUSED(impinge_winding_numbers(detector, scene, 0, at, NULL), "windings is NULL");
  REFUSED(impinge_winding_numbers(detector, scene, 4, at, windings), "no body 4");
  REFUSED(impinge_winding_numbers(detector, scene, 0, faces, windings), "points: its type is IMPINGE_U32");
  CHECK(windings[0] == 9);
  REFUSED(impinge_locate(NULL, scene, 0, at, tetrahedra), "detector is NULL");
  REFUSED(impinge_locate(detector, NULL, 0, at, tetrahedra), "scene is NULL");
  REFUSED(impinge_locate(detector, scene, 0, at, tetrahedra), "body 0");
  CHECK(strstr(impinge_error_message(), "tetrahedra") != NULL);
  REFUSED(impinge_locate(detector, scene, 4, at, tetrahedra), "no body 4");
  {
    static const uint32_t cell[1][4] = {{0, 1, 2, 3}};
    uint32_t solid = 9;
    GOOD(impinge_scene_add_tetrahedra(scene, packed(cell, 1, IMPINGE_U32), at, &solid));
    REFUSED(impinge_locate(detector, scene, solid, at, NULL), "tetrahedra is NULL");
    REFUSED(impinge_locate(detector, scene, solid, faces, tetrahedra), "points: its type is IMPINGE_U32");
    one.positions[7][1] = NAN;
    REFUSED(impinge_locate(detector, scene, solid, at, tetrahedra), "points: row 7");
    one.positions[7][1] = number;
    CHECK(tetrahedra[0] == 9);
    GOOD(impinge_locate(detector, scene, solid, packed(NULL, 0, IMPINGE_F32), NULL));
    GOOD(impinge_scene_remove(scene, solid));
  }
  REFUSED(impinge_cast(detector, scene, at, at, NAN, NULL, &hits), "most: NaN");
  REFUSED(impinge_find_safe_distances(detector, scene, -1, NULL, &safe), "most: -1");
  REFUSED(impinge_find_safe_distances(detector, scene, HUGE_VAL, NULL, &safe), "most: inf");
  REFUSED(impinge_find_neighbours(detector, scene, NAN, NULL, &lists), "distance: NaN");
  REFUSED(impinge_find_nearest(detector, scene, NULL, &nearest, &found), "self-collision");
  REFUSED(impinge_truncate(detector, scene, NULL, NULL), "motion is NULL");
  REFUSED(impinge_truncate(NULL, scene, NULL, &motion), "detector is NULL");
  CHECK(motion == NULL);
  REFUSED(impinge_find_devices(NULL), "devices is NULL");
  REFUSED(impinge_scene_set_groups(scene, 0, packed(beyond, 3, IMPINGE_U32)), "body 0");
  REFUSED(impinge_scene_set_groups(scene, 0, packed(wide, 3, IMPINGE_I64)), "groups: row 2 has 4294967296");
  REFUSED(impinge_scene_set_pinned(scene, 0, packed(beyond, 3, IMPINGE_U32)), "pinned: row 2 has 1154, where 0 or 1");
  REFUSED(impinge_scene_set_pinned(scene, 0, at), "IMPINGE_F64");
  REFUSED(impinge_neighbours_first(NULL, 0, NULL), "neighbours is NULL");
  REFUSED(impinge_safe_distances_of(NULL, 0, &bad), "safe_distances is NULL");
  CHECK(impinge_safe_distances_touching(NULL) == NULL && impinge_neighbours_count(NULL) == 0 && impinge_closest_count(NULL) == 0);
  CHECK(impinge_hits_n_rays(NULL) == 0 && impinge_hits_hash(NULL) == 0 && impinge_closest_hash(NULL) == 0 && impinge_closest_n_nearest(NULL) == 0 && impinge_devices_count(NULL) == 0);
  CHECK(impinge_motion_n_cut(NULL) == 0 && impinge_motion_n_touching(NULL) == 0 && impinge_motion_rounds(NULL) == 0);
  impinge_safe_distances_destroy(NULL);
  impinge_neighbours_destroy(NULL);
  impinge_closest_destroy(NULL);
  impinge_hits_destroy(NULL);
  impinge_devices_destroy(NULL);

  /* Queries. */
#define QUERY(field, value, text)                                                                                       \
  impinge_query_default(&query);                                                                                        \
  query.field = (value);                                                                                                \
  REFUSED(impinge_detect(detector, scene, &query, &pairs), (text))
  QUERY(size, 0, "size is 0");
  QUERY(size, sizeof query + 8, "impinge_query");
  QUERY(between, 2, "between: 2");
  QUERY(shared_vertex, 2, "shared_vertex: 2");
  QUERY(a, 3, "no body 3");
  QUERY(b, 0, "b: 0");
  QUERY(kinds, IMPINGE_VF, "kinds: ");
  QUERY(hits, 3, "hits: 3");
  QUERY(flags, IMPINGE_SIGNED, "flags: 4");
  QUERY(flags, 1u << 20, "flags");
  impinge_query_default(&query);
  query.n_fixed = 1;
  REFUSED(impinge_find_safe_distances(detector, scene, 1, &query, &safe), "fixed: NULL");
  query.fixed = &fixed;
  REFUSED(impinge_find_safe_distances(detector, scene, 1, &query, &safe), "no body 3");
  CHECK(safe == NULL);
  impinge_query_default(&query);
  query.n_exclusions = 1;
  REFUSED(impinge_detect(detector, scene, &query, &pairs), "exclusions: NULL");
  memset(&exclusion, 0, sizeof exclusion);
  exclusion.kind = 4;
  query.exclusions = &exclusion;
  REFUSED(impinge_detect(detector, scene, &query, &pairs), "exclusions[0].kind: 4");
  exclusion.kind = IMPINGE_EXCLUDE_RINGS;
  exclusion.n = 17;
  REFUSED(impinge_detect(detector, scene, &query, &pairs), "rings: 17");
  exclusion.n = 1;
  REFUSED(impinge_find_nearest(detector, scene, &query, &nearest, &found), "rings");
  impinge_query_default(&query);
  query.n_rest_pairs = 1;
  REFUSED(impinge_find_near(detector, scene, 0, &query, &near_pairs), "rest_pairs: NULL");
  query.rest_pairs = (const impinge_near *const *)&near_pairs;
  REFUSED(impinge_find_near(detector, scene, 0, &query, &other_near), "rest_pairs[0] is NULL");
  impinge_query_default(&query);
  query.size = offsetof(impinge_query, rest_pairs);
  query.n_rest_pairs = 1;
  GOOD(impinge_find_near(detector, scene, 0, &query, &near_pairs));
  impinge_near_destroy(near_pairs);
  impinge_query_default(&query);
  query.between = query.self = 0;
  REFUSED(impinge_count(detector, scene, &query, &n), "between and self");
  query.self = 1;
  query.start = 9;
  REFUSED(impinge_is_free(detector, scene, &query, &found), "start: 9");
  query.start = IMPINGE_START_REPORT;
  query.separation = -0.5;
  REFUSED(impinge_is_free(detector, scene, &query, &found), "separation: -0.5");
  query.separation = 0;
  query.clearance_share = 1;
  REFUSED(impinge_is_free(detector, scene, &query, &found), "clearance_share: 1");
  query.precision = 77;
  REFUSED(impinge_is_free(detector, scene, &query, &found), "precision: 77");
  impinge_query_default(&query);
  query.kinds = 64;
  REFUSED(impinge_find_near(detector, scene, 0, &query, (impinge_near **)&pairs), "kinds: 64");
  query.kinds = IMPINGE_EF;
  REFUSED(impinge_is_free(detector, scene, &query, &found), "kinds: ef");
  query.kinds = 0;
  query.flags = IMPINGE_CELL;
  REFUSED(impinge_advance(detector, scene, &query, &number, NULL), "cell_low and cell_high: a cell");

  /* Settings. */
#define SETTING(field, value, text)                                                                                     \
  impinge_settings_default(&settings);                                                                                  \
  settings.field = (value);                                                                                             \
  REFUSED(impinge_detector_create(&settings, &refused), (text));                                                        \
  CHECK(refused == NULL)
  SETTING(size, 0, "size is 0");
  SETTING(backend, 7, "backend: 7");
  SETTING(method, 4, "method: 4");
  SETTING(threads, 100000, "threads");
  SETTING(reuse_margin, -1, "reuse_margin: -1");
  {
    /* Settings of an older header have no margin. */
    impinge_settings_default(&settings);
    settings.size = offsetof(impinge_settings, reuse_margin);
    settings.reuse_margin = -1;
    GOOD(impinge_detector_create(&settings, &refused));
    impinge_detector_destroy(refused);
    refused = NULL;
  }
#ifndef WITH_GPU
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_GPU;
  CHECK(impinge_detector_create(&settings, &refused) == IMPINGE_ERROR_DEVICE);
#endif

  /* One pair. */
  REFUSED(impinge_first_contact(IMPINGE_FF, at, at, NULL, &number, &found), "kind: 32");
  REFUSED(impinge_first_contact(IMPINGE_VF, at, at, NULL, &number, &found), "start: 1154 rows given, 4 needed");

  {
    /* Pointers that are not aligned: input is refused, and results are written where they are to be. */
    static double numbers[16];
    static int64_t results[16];
    char *off = (char *)numbers + 1, *to = (char *)results + 1;
    const impinge_pair *rows = (const impinge_pair *)(const void *)(off + 1);
    impinge_scene *made = NULL;
    uint32_t map[2];
    uint64_t count = 9;
    double distance = 9, corner = 9;
    memset(&exclusion, 0, sizeof exclusion);
    REFUSED(impinge_detect(detector, scene, (const impinge_query *)(void *)off, &pairs), "impinge_query at 0x");
    REFUSED(impinge_project_psd((double *)(void *)off, 1, 3), "is not aligned to 8 bytes");
    REFUSED(impinge_scene_set_positions((impinge_scene *)(void *)off, 0, at), "scene at 0x");
    GOOD(impinge_count(detector, scene, NULL, (uint64_t *)(void *)to));
    memcpy(&count, to, sizeof count);
    CHECK(count == 0);
    GOOD(impinge_scene_create((impinge_scene **)(void *)to));
    memcpy(&made, to, sizeof made);
    CHECK(made != NULL && impinge_scene_n_bodies(made) == 0);
    GOOD(impinge_scene_add_points(made, packed(NULL, 0, 0), (uint32_t *)(void *)to));
    impinge_scene_destroy(made);
    GOOD(impinge_weld(packed(numbers, 2, IMPINGE_F64), (uint32_t *)(void *)to, (uint32_t *)(void *)(to + 12), (size_t *)(void *)(to + 24)));
    memcpy(map, to, sizeof map);
    memcpy(&size, to + 24, sizeof size);
    CHECK(map[0] == 0 && map[1] == 0 && size == 1);
    GOOD(impinge_signed_distance(detector, scene, 0, packed(numbers, 1, IMPINGE_F64), (double *)(void *)to));
    memcpy(&distance, to, sizeof distance);
    GOOD(impinge_signed_distance(detector, scene, 0, packed(numbers, 1, IMPINGE_F64), &corner));
    CHECK(distance == corner && distance > 0.9);
    GOOD(impinge_winding_numbers(detector, scene, 0, packed(numbers, 1, IMPINGE_F64), (int32_t *)(void *)to));
    CHECK(impinge_hash_pairs(rows, 1) == impinge_hash_pairs((const impinge_pair *)(void *)numbers, 1));
  }
  {
    /* Of no rows the type does not count. */
    static const float not_numbers[2][3] = {{NAN, 0, HUGE_VALF}, {NAN, 0, HUGE_VALF}}, inf[2][3] = {{0, 0, HUGE_VALF}, {-0.0f, 0, HUGE_VALF}};
    const impinge_array none = {0};
    uint32_t empty = 9, map[2];
    GOOD(impinge_scene_add_triangles(scene, none, none, &empty));
    GOOD(impinge_scene_set_edges(scene, 0, none));
    GOOD(impinge_scene_set_positions(scene, empty, none));
    GOOD(impinge_scene_set_groups(scene, empty, none));
    GOOD(impinge_scene_set_pinned(scene, empty, none));
    GOOD(impinge_scene_remesh(scene, empty, IMPINGE_POINTS, none, none));
    GOOD(impinge_scene_remove(scene, empty));
    GOOD(impinge_contains(detector, scene, 0, none, NULL));
    GOOD(impinge_cast(detector, scene, none, none, 1, NULL, &hits));
    impinge_hits_destroy(hits);
    GOOD(impinge_weld(none, NULL, NULL, &size));
    CHECK(size == 0);
    REFUSED(impinge_scene_set_positions(scene, 0, none), "body 0: 0 positions given");
    /* Welding compares numbers. */
    GOOD(impinge_weld(packed(not_numbers, 2, IMPINGE_F32), map, NULL, &size));
    CHECK(size == 2);
    GOOD(impinge_weld(packed(inf, 2, IMPINGE_F32), map, NULL, &size));
    CHECK(size == 1);
  }
  {
    /* A body that stands still has no rows, and one that was not there is refused. */
    GOOD(impinge_truncate(detector, scene, NULL, &motion));
    GOOD(impinge_motion_positions(motion, 0, &bad));
    CHECK(bad.rows == 0);
    REFUSED(impinge_motion_positions(motion, 77, &bad), "no body 77 among the 1");
    impinge_motion_destroy(motion);
    GOOD(impinge_advance(detector, scene, NULL, NULL, &motion));
    REFUSED(impinge_motion_positions(motion, 77, &bad), "no body 77 among the 1");
    candidates = (impinge_candidates *)scene;
    REFUSED(impinge_motion_pairs(motion, &candidates), "impinge_advance");
    CHECK(candidates == NULL);
    REFUSED(impinge_motion_pairs(NULL, &candidates), "motion is NULL");
    REFUSED(impinge_motion_pairs(motion, NULL), "pairs is NULL");
    impinge_motion_destroy(motion);
  }
  {
    /* Messages name the fields of C. */
    impinge_query_default(&query);
    query.flags = IMPINGE_CELL;
    query.cell_low[0] = NAN;
    REFUSED(impinge_detect(detector, scene, &query, &pairs), "cell_low and cell_high: [NaN");
    impinge_query_default(&query);
    query.kinds = IMPINGE_VF;
    REFUSED(impinge_find_closest(detector, scene, at, 1, &query, &closest), "all bodies, or the one in the field a allowed");
  }

  /* Nothing has changed. */
  CHECK(n == 7 && impinge_scene_n_bodies(scene) == 1 && hash_of(detector, scene, NULL) == 0);
  {
    /* A query of a shorter header: what it lacks is as by default. */
    impinge_query_default(&query);
    query.size = offsetof(impinge_query, kinds);
    query.kinds = 12345;
    CHECK(hash_of(detector, scene, &query) == 0);
  }
  {
    /* A vertex falls onto a face. */
    static const float start[4][3] = {{0.25f, 0.25f, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static const float end[4][3] = {{0.25f, 0.25f, -1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    GOOD(impinge_first_contact(IMPINGE_VF, packed(start, 4, IMPINGE_F32), packed(end, 4, IMPINGE_F32), NULL, &number, &found));
    CHECK(found == 1 && number == 0.5);
    GOOD(impinge_first_contact(IMPINGE_VF, packed(start, 4, IMPINGE_F32), packed(start, 4, IMPINGE_F32), NULL, &number, &found));
    CHECK(found == 0);
    REFUSED(impinge_first_contact(IMPINGE_VF, packed(start, 4, IMPINGE_F32), packed(start, 4, IMPINGE_F32), NULL, NULL, &found), "toi is NULL");
    impinge_query_default(&query);
    query.separation = -1e-300;
    REFUSED(impinge_first_contact(IMPINGE_VF, packed(start, 4, IMPINGE_F32), packed(end, 4, IMPINGE_F32), &query, &number, &found), "separation: -1e-300 given");
    /* The edge comes first: here the edge from (0, 0, 0) to (1, 0, 0), and a vertex that crosses it. */
    {
      static const float from[3][3] = {{0, 0, 0}, {1, 0, 0}, {0.5f, 0, 1}}, to[3][3] = {{0, 0, 0}, {1, 0, 0}, {0.5f, 0, -3}};
      GOOD(impinge_first_contact(IMPINGE_EV, packed(from, 3, IMPINGE_F32), packed(to, 3, IMPINGE_F32), NULL, &number, &found));
      CHECK(found == 1 && number == 0.25);
      impinge_query_default(&query);
      query.separation = 0.5;
      GOOD(impinge_first_contact(IMPINGE_EV, packed(from, 3, IMPINGE_F32), packed(to, 3, IMPINGE_F32), &query, &number, &found));
      CHECK(found == 1 && number == 0.125);
    }
  }
  {
    /* NULL is refused also where nothing would be written. */
    impinge_array none = at;
    none.rows = 0;
    REFUSED(impinge_find_earliest(detector, scene, NULL, NULL, &found), "impact is NULL");
    GOOD(impinge_advance(detector, scene, NULL, NULL, &motion));
    REFUSED(impinge_motion_first(motion, NULL, &found), "impact is NULL");
    impinge_motion_destroy(motion);
    GOOD(impinge_scene_add_points(scene, none, NULL));
    REFUSED(impinge_find_distance(detector, scene, 0, 1, NULL, &found), "nearest is NULL");
    impinge_query_default(&query);
    query.self = 0;
    REFUSED(impinge_find_nearest(detector, scene, &query, NULL, &found), "nearest is NULL");
    CHECK(found == 1);
  }
  impinge_detector_destroy(detector);
  impinge_scene_destroy(scene);
  return finish("arguments");
}
