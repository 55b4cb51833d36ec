/* Prints the layout of every structure of impinge.h and the value of every constant that Rust has too: src/tests.rs compares them with its own. */
#include <impinge.h>
#include <stdio.h>

#define SIZE(s) printf(#s " %lu\n", (unsigned long)sizeof(s))
#define FIELD(s, f) printf(#s "." #f " %lu\n", (unsigned long)offsetof(s, f))
#define VALUE(c) printf(#c " %lu\n", (unsigned long)(IMPINGE_##c))

int main(void) {
  SIZE(impinge_status);
  SIZE(impinge_array);
  FIELD(impinge_array, data); FIELD(impinge_array, rows); FIELD(impinge_array, row_stride); FIELD(impinge_array, column_stride);
  FIELD(impinge_array, type);
  SIZE(impinge_exclusion);
  FIELD(impinge_exclusion, kind); FIELD(impinge_exclusion, a); FIELD(impinge_exclusion, b); FIELD(impinge_exclusion, n);
  FIELD(impinge_exclusion, offsets); FIELD(impinge_exclusion, vertices);
  SIZE(impinge_query);
  FIELD(impinge_query, size); FIELD(impinge_query, between); FIELD(impinge_query, self); FIELD(impinge_query, shared_vertex);
  FIELD(impinge_query, a); FIELD(impinge_query, b); FIELD(impinge_query, kinds); FIELD(impinge_query, start);
  FIELD(impinge_query, precision); FIELD(impinge_query, hits); FIELD(impinge_query, n_nearest); FIELD(impinge_query, flags);
  FIELD(impinge_query, separation); FIELD(impinge_query, clearance); FIELD(impinge_query, clearance_share);
  FIELD(impinge_query, cell_low); FIELD(impinge_query, cell_high); FIELD(impinge_query, exclusions);
  FIELD(impinge_query, n_exclusions); FIELD(impinge_query, fixed); FIELD(impinge_query, n_fixed); FIELD(impinge_query, passes);
  FIELD(impinge_query, passes_user); FIELD(impinge_query, rest_pairs); FIELD(impinge_query, n_rest_pairs);
  SIZE(impinge_element);
  FIELD(impinge_element, vertices); FIELD(impinge_element, n_vertices); FIELD(impinge_element, body);
  SIZE(impinge_settings);
  FIELD(impinge_settings, size); FIELD(impinge_settings, backend); FIELD(impinge_settings, method); FIELD(impinge_settings, threads);
  FIELD(impinge_settings, memory_budget); FIELD(impinge_settings, max_pairs); FIELD(impinge_settings, cancelled);
  FIELD(impinge_settings, user); FIELD(impinge_settings, progress); FIELD(impinge_settings, log); FIELD(impinge_settings, device); FIELD(impinge_settings, reuse_margin);
  SIZE(impinge_pair);
  FIELD(impinge_pair, body_a); FIELD(impinge_pair, element_a); FIELD(impinge_pair, body_b); FIELD(impinge_pair, element_b);
  SIZE(impinge_impact);
  FIELD(impinge_impact, toi); FIELD(impinge_impact, kind); FIELD(impinge_impact, body_a); FIELD(impinge_impact, element_a);
  FIELD(impinge_impact, body_b); FIELD(impinge_impact, element_b); FIELD(impinge_impact, at_start);
  SIZE(impinge_nearest);
  FIELD(impinge_nearest, distance); FIELD(impinge_nearest, points); FIELD(impinge_nearest, body_a); FIELD(impinge_nearest, element_a);
  FIELD(impinge_nearest, body_b); FIELD(impinge_nearest, element_b);
  SIZE(impinge_device);
  FIELD(impinge_device, name); FIELD(impinge_device, interface_name); FIELD(impinge_device, driver); FIELD(impinge_device, max_binding);
  FIELD(impinge_device, is_software); FIELD(impinge_device, reserved);
  SIZE(impinge_closest_element);
  FIELD(impinge_closest_element, distance); FIELD(impinge_closest_element, point); FIELD(impinge_closest_element, body);
  FIELD(impinge_closest_element, element); FIELD(impinge_closest_element, feature); FIELD(impinge_closest_element, found);
  SIZE(impinge_ray_hit);
  FIELD(impinge_ray_hit, t); FIELD(impinge_ray_hit, t_end); FIELD(impinge_ray_hit, barycentrics); FIELD(impinge_ray_hit, ray);
  FIELD(impinge_ray_hit, body); FIELD(impinge_ray_hit, element); FIELD(impinge_ray_hit, feature); FIELD(impinge_ray_hit, reserved);
  SIZE(impinge_region);
  FIELD(impinge_region, position); FIELD(impinge_region, bounds); FIELD(impinge_region, length); FIELD(impinge_region, patch_area);
  FIELD(impinge_region, area); FIELD(impinge_region, normal); FIELD(impinge_region, depth); FIELD(impinge_region, volume);
  FIELD(impinge_region, body_a); FIELD(impinge_region, body_b); FIELD(impinge_region, n_contacts); FIELD(impinge_region, n_inside);
  SIZE(impinge_stats);
  FIELD(impinge_stats, size); FIELD(impinge_stats, n_threads); FIELD(impinge_stats, total_ms); FIELD(impinge_stats, n_candidates);
  FIELD(impinge_stats, n_unsure); FIELD(impinge_stats, n_work_items); FIELD(impinge_stats, n_clusters); FIELD(impinge_stats, n_culled);
  FIELD(impinge_stats, n_clustered); FIELD(impinge_stats, n_batches); FIELD(impinge_stats, n_reruns); FIELD(impinge_stats, bytes_held);
  FIELD(impinge_stats, backend); FIELD(impinge_stats, method);
  VALUE(OK); VALUE(ERROR_INVALID); VALUE(ERROR_OUT_OF_MEMORY); VALUE(ERROR_BUDGET); VALUE(ERROR_TOO_MANY_PAIRS);
  VALUE(ERROR_CANCELLED); VALUE(ERROR_DEVICE); VALUE(ERROR_INTERNAL); VALUE(ABI_VERSION);
  VALUE(F32); VALUE(F64); VALUE(U32); VALUE(I32); VALUE(U64); VALUE(I64); VALUE(U8);
  VALUE(POINTS); VALUE(EDGES); VALUE(TRIANGLES); VALUE(TETRAHEDRA); VALUE(ANY_BODY);
  VALUE(BACKEND_AUTO); VALUE(BACKEND_CPU); VALUE(BACKEND_GPU);
  VALUE(METHOD_AUTO); VALUE(METHOD_CLUSTERS); VALUE(METHOD_CELLS); VALUE(METHOD_NAIVE); VALUE(SKIP); VALUE(RESOLVE);
  VALUE(START_REPORT); VALUE(START_SKIP); VALUE(START_VERIFY); VALUE(DISTANCES); VALUE(CLOSEST_POINTS); VALUE(SIGNED); VALUE(CELL);
  VALUE(HITS_FIRST); VALUE(HITS_ANY); VALUE(HITS_ALL); VALUE(EXCLUDE_BODIES); VALUE(EXCLUDE_RINGS); VALUE(EXCLUDE_GROUPS); VALUE(EXCLUDE_VERTICES); VALUE(NO_FEATURE); VALUE(NO_ELEMENT); VALUE(ON_SURFACE); VALUE(LOG_ERROR); VALUE(LOG_INFO);
  VALUE(SHAPE_SOLID); VALUE(SHAPE_EMPTY); VALUE(SHAPE_POINT); VALUE(SHAPE_SEGMENT); VALUE(SHAPE_POLYGON);
  VALUE(VF); VALUE(EE); VALUE(EV); VALUE(VV); VALUE(EF); VALUE(FF);
  VALUE(COLUMN_KIND); VALUE(COLUMN_ROWS); VALUE(COLUMN_DISTANCE); VALUE(COLUMN_POINTS); VALUE(COLUMN_FEATURES);
  VALUE(COLUMN_PARALLEL); VALUE(COLUMN_TOI); VALUE(COLUMN_AT_START); VALUE(COLUMN_SHAPE); VALUE(COLUMN_STARTS);
  VALUE(COLUMN_CORNERS); VALUE(COLUMN_CONTACT_POINTS); VALUE(COLUMN_CURVE_STARTS); VALUE(COLUMN_CURVE_POINTS);
  VALUE(COLUMN_CURVE_CLOSED); VALUE(COLUMN_CURVE_LENGTH); VALUE(COLUMN_INSIDE_A); VALUE(COLUMN_INSIDE_B);
  VALUE(COLUMN_IS_HIT); VALUE(COLUMN_T); VALUE(COLUMN_T_END); VALUE(COLUMN_BARYCENTRICS);
  VALUE(COLUMN_VERTICES); VALUE(COLUMN_WEIGHT); VALUE(COLUMN_COEFFICIENTS); VALUE(COLUMN_SQUARED_DISTANCE); VALUE(COLUMN_GRADIENT); VALUE(COLUMN_HESSIAN); VALUE(COLUMN_MOLLIFIER); VALUE(COLUMN_MOLLIFIER_GRADIENT); VALUE(COLUMN_MOLLIFIER_HESSIAN); VALUE(COLUMN_KEPT); VALUE(COLUMN_NEW); VALUE(COLUMN_GONE);
  return 0;
}
