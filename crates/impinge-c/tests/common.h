/* What the programs of these tests share: checks, and a ball. */
#ifndef COMMON_H
#define COMMON_H

#include <impinge.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int n_failed = 0;

/* Says where a check failed, with the message of the last failed call. */
#define CHECK(what)                                                                                                     \
  do {                                                                                                                  \
    if (!(what)) {                                                                                                      \
      fprintf(stderr, "%s:%d: %s\n    %s\n", __FILE__, __LINE__, #what, impinge_error_message());                       \
      ++n_failed;                                                                                                       \
    }                                                                                                                   \
  } while (0)
#define GOOD(call) CHECK((call) == IMPINGE_OK)
/* A call that must be refused, with a message that has this text. */
#define REFUSED(call, text)                                                                                             \
  do {                                                                                                                  \
    CHECK((call) == IMPINGE_ERROR_INVALID);                                                                             \
    CHECK(strstr(impinge_error_message(), (text)) != NULL);                                                             \
  } while (0)

/* A closed ball of radius 1 around (x, 0, 0), its vertices shared: RINGS rings of SEGMENTS vertices, and two poles. */
enum { RINGS = 24, SEGMENTS = 48, VERTICES = RINGS * SEGMENTS + 2, FACES = 2 * RINGS * SEGMENTS };
typedef struct {
  double positions[VERTICES][3];
  uint32_t faces[FACES][3];
} ball;

static void make_ball(ball *to, double x) {
  const double pi = 3.14159265358979323846;
  uint32_t ring, segment, n = 0;
  for (ring = 0; ring < RINGS; ++ring)
    for (segment = 0; segment < SEGMENTS; ++segment) {
      double up = pi * (ring + 1) / (RINGS + 1), around = 2 * pi * segment / (int)SEGMENTS;
      double *at = to->positions[ring * SEGMENTS + segment];
      at[0] = x + sin(up) * cos(around);
      at[1] = sin(up) * sin(around);
      at[2] = cos(up);
    }
  for (segment = 0; segment < 2; ++segment) {
    double *at = to->positions[RINGS * SEGMENTS + segment];
    at[0] = x;
    at[1] = 0;
    at[2] = segment ? -1 : 1;
  }
  for (segment = 0; segment < SEGMENTS; ++segment) {
    uint32_t next = (segment + 1) % SEGMENTS, last = (RINGS - 1) * SEGMENTS;
    uint32_t caps[2][3];
    caps[0][0] = RINGS * SEGMENTS, caps[0][1] = segment, caps[0][2] = next;
    caps[1][0] = RINGS * SEGMENTS + 1, caps[1][1] = last + next, caps[1][2] = last + segment;
    memcpy(to->faces[n], caps, sizeof caps);
    n += 2;
    for (ring = 0; ring + 1 < RINGS; ++ring) {
      uint32_t a = ring * SEGMENTS + segment, b = ring * SEGMENTS + next;
      uint32_t quad[2][3];
      quad[0][0] = a, quad[0][1] = a + SEGMENTS, quad[0][2] = b;
      quad[1][0] = b, quad[1][1] = a + SEGMENTS, quad[1][2] = b + SEGMENTS;
      memcpy(to->faces[n], quad, sizeof quad);
      n += 2;
    }
  }
}

/* Packed rows. */
static impinge_array packed(const void *data, size_t rows, uint32_t type) {
  impinge_array array;
  memset(&array, 0, sizeof array);
  array.data = data;
  array.rows = rows;
  array.type = type;
  return array;
}

static impinge_array faces_of(const ball *of) { return packed(of->faces, FACES, IMPINGE_U32); }
static impinge_array positions_of(const ball *of) { return packed(of->positions, VERTICES, IMPINGE_F64); }

/* A detector on the CPU. */
static impinge_detector *open_detector(uint32_t threads) {
  impinge_settings settings;
  impinge_detector *detector = NULL;
  impinge_settings_default(&settings);
  settings.backend = IMPINGE_BACKEND_CPU;
  settings.threads = threads;
  GOOD(impinge_detector_create(&settings, &detector));
  return detector;
}

static uint64_t hash_of(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query) {
  impinge_pairs *pairs = NULL;
  uint64_t hash;
  GOOD(impinge_detect(detector, scene, query, &pairs));
  hash = impinge_pairs_hash(pairs);
  CHECK(hash == impinge_hash_pairs(impinge_pairs_data(pairs), impinge_pairs_count(pairs)));
  impinge_pairs_destroy(pairs);
  return hash;
}

/* Prints what failed; the result of main. */
static int finish(const char *name) {
  if (n_failed)
    fprintf(stderr, "%s: %d checks failed\n", name, n_failed);
  else
    printf("%s: good\n", name);
  return n_failed != 0;
}

#endif
