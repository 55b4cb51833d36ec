/* Two meshes: which faces intersect, how near the meshes are, and how far one can move towards the other. See docs/c.md. */
#include <impinge.h>
#include <stdio.h>
#include <stdlib.h>

/* Ends the program if a call has failed. */
static void check(impinge_status status) {
  if (status == IMPINGE_OK) return;
  fprintf(stderr, "two_meshes: %s\n", impinge_error_message());
  exit(1);
}

int main(void) {
  static const uint32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  static const float a[4][3] = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}};
  static const float b[4][3] = {{0.5f, 0.5f, 0.5f}, {3, 0.5f, 0.5f}, {0.5f, 3, 0.5f}, {0.5f, 0.5f, 3}};
  float away[4][3];
  const impinge_array of = {faces, 4, 0, 0, IMPINGE_U32}; /* strides of 0: packed rows */
  const impinge_array at_a = {a, 4, 0, 0, IMPINGE_F32}, at_b = {b, 4, 0, 0, IMPINGE_F32}, at_away = {away, 4, 0, 0, IMPINGE_F32};
  impinge_scene *scene;
  impinge_detector *detector;
  impinge_pairs *pairs;
  impinge_motion *motion;
  impinge_nearest nearest;
  impinge_step step;
  uint32_t first, second;
  int32_t found;
  double fraction;
  size_t i;

  check(impinge_scene_create(&scene));
  check(impinge_scene_add_triangles(scene, of, at_a, &first));
  check(impinge_scene_add_triangles(scene, of, at_b, &second));
  check(impinge_detector_create(NULL, &detector));

  check(impinge_detect(detector, scene, NULL, &pairs));
  for (i = 0; i < impinge_pairs_count(pairs); ++i)
    printf("face %u meets face %u\n", impinge_pairs_data(pairs)[i].element_a, impinge_pairs_data(pairs)[i].element_b);
  impinge_pairs_destroy(pairs);

  /* The second one starts 10 to the right, and wants to go to where it was. */
  for (i = 0; i < 4; ++i) away[i][0] = b[i][0] + 10, away[i][1] = b[i][1], away[i][2] = b[i][2];
  check(impinge_scene_set_positions(scene, second, at_away));
  check(impinge_scene_set_end_positions(scene, second, at_b));
  impinge_step_default(&step);
  step.clearance = 1e-3;
  check(impinge_advance(detector, scene, &step, &fraction, &motion));
  check(impinge_motion_apply(motion, scene));
  impinge_motion_destroy(motion);
  check(impinge_find_distance(detector, scene, first, second, &nearest, &found));
  printf("it goes %.4f of the way, and is then %.4f away\n", fraction, nearest.distance);

  impinge_detector_destroy(detector);
  impinge_scene_destroy(scene);
  return 0;
}
