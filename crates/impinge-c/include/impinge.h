/* impinge.h: exact collision detection for deforming meshes.
 *
 * A scene holds bodies, a query says which pairs and how, a detector answers. Every pair is decided exactly: touching counts, and there is
 * no tolerance. Answers are sorted and depend on the input alone.
 *
 * Ownership. A handle that a function creates belongs to the caller, who ends it with the `_destroy` of its type; `_destroy(NULL)` does
 *   nothing. Nothing that is passed in is kept after a call returns, but for lent positions and the callbacks of a detector.
 *   An answer outlives the scene, the detector and later questions. A view of a handle ends when the handle is destroyed or changed.
 * Errors. Most functions return a status: IMPINGE_OK, or what is wrong, and impinge_error_message() says which body, row and value. Then
 *   a handle that the call should have made is NULL, other results are unchanged, and a scene is as it was before. NULL where no NULL
 *   is allowed is IMPINGE_ERROR_INVALID. After IMPINGE_ERROR_INTERNAL the handle that the call would have changed, a scene or a detector,
 *   refuses everything but its end, with the same status and a message that it is broken. That does not break what it is used with: a
 *   detector that was asked about a broken scene answers about others.
 * Threads. A handle may move between threads, and one thread at a time may change it. A detector is changed by each question. A scene
 *   is only read by a question, so threads with a detector each may ask about one scene at the same time; answers are only read too.
 *   A detector that is asked while it answers, by another thread or by one of its own callbacks, refuses the second question: INVALID, with
 *   a message that it is in use. The first question goes on. In the same way a scene refuses changes while a question, or another call,
 *   reads it, also those of the question's callbacks; and it refuses to be read while another call changes it.
 *   A scene or a detector must not be destroyed while another thread may call a function with it. Where a call is using it, as in a callback,
 *   its `_destroy` does nothing: impinge_error_message() says so, and it must be called again.
 * Units. Lengths are in the unit of the scene. Times are fractions of a step, from 0 to 1.
 * The library prints nothing and installs no signal handlers. It reads no environment variables, but Rust's standard library reads
 *   RUST_MIN_STACK, the bytes of a thread's stack, where it starts the first one, and drivers of GPUs read theirs.
 */
#ifndef IMPINGE_H
#define IMPINGE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Statuses ---- */

/* What became of a call: one of the following. */
typedef int32_t impinge_status;

#define IMPINGE_OK 0                  /* It did what it says. */
#define IMPINGE_ERROR_INVALID 1       /* An argument is refused, or the handle is in use by another call. */
#define IMPINGE_ERROR_OUT_OF_MEMORY 2 /* There is no memory for the input or the answer. */
#define IMPINGE_ERROR_BUDGET 3        /* The memory budget of the settings is too small for this question. */
#define IMPINGE_ERROR_TOO_MANY_PAIRS 4 /* More pairs than the settings allow. */
#define IMPINGE_ERROR_CANCELLED 5     /* The callback `cancelled` stopped it. */
#define IMPINGE_ERROR_DEVICE 6        /* There is no such GPU, or it failed. */
#define IMPINGE_ERROR_INTERNAL 7      /* A defect of this library, now or in an earlier call with the handle, which refuses further use. */

/* The message of the last call of this thread that failed, in English. Never NULL; empty if none has failed. Valid until this thread's
 * next call that fails. */
const char *impinge_error_message(void);

/* The version of the library, such as "0.1.0". It lives as long as the program. */
const char *impinge_version(void);

/* The version of the binary interface that the library has. */
uint32_t impinge_abi_version(void);

/* The version that this header describes: equal to impinge_abi_version(), if header and library belong together. */
#define IMPINGE_ABI_VERSION 1

/* ---- Arrays ---- */

/* Types of numbers. U8 is that of some columns of answers, and of input only in impinge_scene_set_pinned. */
#define IMPINGE_F32 1
#define IMPINGE_F64 2
#define IMPINGE_U32 3
#define IMPINGE_I32 4
#define IMPINGE_U64 5
#define IMPINGE_I64 6
#define IMPINGE_U8 7

/* Rows of numbers anywhere in memory: 3 in a row of positions, 1 to 4 in a row of elements, as each function says.
 *
 * The number in row i and column j lies at (char *)data + i * row_stride + j * column_stride. So rows may be parts of larger structures,
 * matrices may be row-major or column-major, and blocks of them need no copy. If both strides are 0, the rows are packed: each follows
 * the one before without a gap. Strides must be multiples of the size of a number, and data aligned to it. If there are no rows, nothing
 * else counts: data may be NULL, and type and strides may be anything, as in impinge_array none = {0}. */
typedef struct impinge_array {
  const void *data;
  size_t rows;
  ptrdiff_t row_stride;    /* bytes; may be negative */
  ptrdiff_t column_stride; /* bytes; may be negative */
  uint32_t type;           /* IMPINGE_F32 ... */
} impinge_array;

/* ---- Scenes ---- */

/* Bodies: topology once, positions every frame. */
typedef struct impinge_scene impinge_scene;

/* A body of a scene is a number: 0 for the first that was added, and so on. The number of a body that was removed is given to a later one.
 * Answers name bodies by these numbers. This one names no body. */
#define IMPINGE_ANY_BODY UINT32_C(0xffffffff)

/* What bodies are made of. */
#define IMPINGE_POINTS 1
#define IMPINGE_EDGES 2
#define IMPINGE_TRIANGLES 3
#define IMPINGE_TETRAHEDRA 4

/* Makes an empty scene. */
impinge_status impinge_scene_create(impinge_scene **scene);

/* Ends a scene, but none that a call is using. Positions that were lent are released, unless an answer still needs them. */
void impinge_scene_destroy(impinge_scene *scene);

/* Adds a body of triangles. `faces` has 3 columns of vertex indices of any integer type, `positions` 3 columns of F32 or F64; both are
 * copied. `body` gets the number of the body and may be NULL.
 * INVALID: an index out of range, a position that is not finite, a type that does not fit, strides that do not fit the type. Messages
 * name the number that the body would have got. */
impinge_status impinge_scene_add_triangles(impinge_scene *scene, impinge_array faces, impinge_array positions, uint32_t *body);

/* Adds a body of tetrahedra, as impinge_scene_add_triangles. `tetrahedra` has 4 columns. Orientation does not matter; a flat one is the
 * flat set that it is. Whether elements intersect is asked of the tetrahedra; distances, steps, points and rays are about their surface, the
 * faces that are not between two of them. It does not bound a body where one is turned inside out: nothing stops at such a face. */
impinge_status impinge_scene_add_tetrahedra(impinge_scene *scene, impinge_array tetrahedra, impinge_array positions, uint32_t *body);

/* Adds a body of edges, such as strands of hair, as impinge_scene_add_triangles. `edges` has 2 columns. */
impinge_status impinge_scene_add_edges(impinge_scene *scene, impinge_array edges, impinge_array positions, uint32_t *body);

/* Adds a body of points, one per row of positions, as impinge_scene_add_triangles. */
impinge_status impinge_scene_add_points(impinge_scene *scene, impinge_array positions, uint32_t *body);

/* Removes a body. A later body may get its number. INVALID: no such body. */
impinge_status impinge_scene_remove(impinge_scene *scene, uint32_t body);

/* Gives a body new elements and positions under its number. `kind` is IMPINGE_TRIANGLES ...; for IMPINGE_POINTS `elements` has no rows.
 * Its filter stays, and its thickness if it is one number; the end of its step, its transform, the thickness, groups and pins of its parts
 * and the caller's numbers of edges are forgotten.
 * INVALID: as impinge_scene_add_triangles, and no such body. */
impinge_status impinge_scene_remesh(impinge_scene *scene, uint32_t body, uint32_t kind, impinge_array elements, impinge_array positions);

/* Numbers the edges of a body as its caller does: `edges` has 2 columns, vertex indices in either order, and edge i of answers, of
 * impinge_scene_edges and of impinge_scene_set_element_thickness is row i. Every edge of the body must be there once, in any order; of
 * tetrahedra these are the edges of their surface. No rows: the library's own numbers again. Set them before the first question:
 * afterwards answers from before name other edges, and are refused where they are left out or made stencils of.
 * INVALID: no such body, a row that is no edge or the same as another, an edge that no row has; a body of edges, whose numbers are the
 * caller's already, or of points. The body keeps its numbers then. */
impinge_status impinge_scene_set_edges(impinge_scene *scene, uint32_t body, impinge_array edges);

/* Moves the vertices of a body: as many rows as it has vertices, 3 columns of F32 or F64, copied. The type may differ from call to call.
 * A new step
 * starts: the body stands still until its end positions are set.
 * INVALID: no such body, another number of rows, a position that is not finite. */
impinge_status impinge_scene_set_positions(impinge_scene *scene, uint32_t body, impinge_array positions);

/* Sets where the vertices are at the end of the step, to which they move on straight lines at constant speed. As
 * impinge_scene_set_positions
 * otherwise. No rows: the body stands still. If start and end differ in type, the F32 one is widened: a body of F32 whose end is given in
 * F64 has F64 positions from then on, also when it stands still again or has taken the step, until impinge_scene_set_positions; one that
 * impinge_scene_set_transform had moved before, until that moves it again. */
impinge_status impinge_scene_set_end_positions(impinge_scene *scene, uint32_t body, impinge_array positions);

/* Moves the vertices without a copy: the scene reads `positions` where they lie. Up to 32,768 of them are checked in this call; more are
 * read once, by the next question, which refuses them with INVALID if one is not finite. None is checked twice, so they must neither change
 * nor move until `release` is called with `user`, which happens once: when the body gets other positions or is removed, when
 * the scene is destroyed, or when the last answer that needs them is; on whatever thread does that. `release` may be NULL and must not call
 * this library.
 * Nothing is copied if rows are packed (3 numbers of F32 or F64 without a gap). Other rows, such as columns of a column-major matrix, are
 * copied, and `release` is called
 * before this function returns. If it fails, `release` is not called.
 * INVALID: as impinge_scene_set_positions. */
impinge_status impinge_scene_lend_positions(impinge_scene *scene, uint32_t body, impinge_array positions, void (*release)(void *user),
    void *user);

/* Sets where the vertices are at the end of the step, without a copy, as impinge_scene_lend_positions. `release` is also called when the
 * end is cleared: by no rows of impinge_scene_set_end_positions, and when a new step starts. */
impinge_status impinge_scene_lend_end_positions(impinge_scene *scene, uint32_t body, impinge_array positions,
    void (*release)(void *user), void *user);

/* Moves a body by an affine matrix without passing its vertices again. `matrix` has 4 rows and 4 columns of F32 or F64, and takes
 * the column (x, y, z, 1) to the moved one; its last row is 0 0 0 1. It moves the positions given last; a second transform replaces the
 * first, also where a step was taken in between by impinge_motion_apply. End positions are cleared.
 * INVALID: no such body, a matrix that is not as described, a moved position that is not finite. */
impinge_status impinge_scene_set_transform(impinge_scene *scene, uint32_t body, impinge_array matrix);

/* Sets where the vertices are at the end of the step by an affine matrix, which moves the positions given last, those that
 * impinge_scene_set_transform moves too, and is rounded as there. The matrices of the two ends of a step both start from these positions,
 * neither from the other.
 * Each vertex goes straight, at constant speed, from its rounded position to its rounded end, not along the arc of a turn; what is proven
 * of a step is proven of this motion. Halfway through a turn the body is smaller, by a factor of the cosine of half the angle; half a turn
 * takes it through its axis. At each moment, a point at distance r from the axis of a screw motion by the angle w (radians) is at most
 * r w^2 / 8 away from where that motion would have it, plus the rounding of the two ends. So cut a large turn into n equal steps,
 * n = ceil(w * sqrt(r / (8 * d))), where r is that of the farthest vertex and d the deviation that is allowed. With a separation of 2 d, d of
 * each of two bodies, a step that is free is free for the screw motion too, up to that rounding.
 * INVALID: as impinge_scene_set_transform; the body keeps its end positions then. */
impinge_status impinge_scene_set_end_transform(impinge_scene *scene, uint32_t body, impinge_array matrix);

/* Sets whom a body meets in queries that name no two bodies: two bodies meet if the category of each shares a bit with the mask of the
 * other. By default category is 1 and mask has all bits. INVALID: no such body. */
impinge_status impinge_scene_set_filter(impinge_scene *scene, uint32_t body, uint64_t category, uint64_t mask);

/* Sets how thick a body is, a length: finite, 0 or more; 0 by default. Of two elements, each adds its own to the distance of
 * impinge_find_near, to the `separation` that elements keep in a step (sums are rounded up there) and to the gap that boxes of
 * impinge_find_candidates may have. It is taken from the distances of impinge_find_neighbours and impinge_find_safe_distances. What
 * intersects, and how far apart bodies are, is asked of the elements themselves.
 * INVALID: no such body, another number. */
impinge_status impinge_scene_set_thickness(impinge_scene *scene, uint32_t body, double thickness);

/* Sets how thick each vertex (`kind`: IMPINGE_POINTS), edge (IMPINGE_EDGES) or face (IMPINGE_TRIANGLES) of a body is: as many rows as it
 * has of these, 1 column of F32 or F64; edges in the caller's order, if impinge_scene_set_edges gave one. Other elements are as thick as
 * the thickest of these that they have or are part of. impinge_scene_set_thickness and impinge_scene_remesh forget it.
 * INVALID: no such body, another number of rows, a number that is negative or not finite. */
impinge_status impinge_scene_set_element_thickness(impinge_scene *scene, uint32_t body, uint32_t kind, impinge_array thickness);

/* Sets the group of each vertex of a body, for IMPINGE_EXCLUDE_GROUPS: as many rows as it has vertices, 1 column of any integer type. A
 * body whose groups were not set has none that could be left out. New elements (impinge_scene_remesh) have no groups.
 * INVALID: no such body, another number of rows, a number below 0 or above 2^32 - 1. */
impinge_status impinge_scene_set_groups(impinge_scene *scene, uint32_t body, impinge_array groups);

/* Says which vertices of a body are pinned, where they never move: as many rows as it has vertices, 1 column of U8 or any integer type,
 * 1 or 0. Pairs of elements all of whose vertices are pinned are left out of every query, so pin no vertices that you move by a script:
 * two such bodies would pass through each other. impinge_find_distance and impinge_find_nearest look at all elements, whatever is pinned.
 * impinge_scene_remesh forgets it.
 * INVALID: no such body, another number of rows, another number than 0 or 1. */
impinge_status impinge_scene_set_pinned(impinge_scene *scene, uint32_t body, impinge_array pinned);

/* The number of bodies; 0 for NULL, while another call changes the scene, and of a broken one. */
size_t impinge_scene_n_bodies(const impinge_scene *scene);

/* Views of a body. Valid until the scene is changed: its positions (3 columns of F32 or F64, as they were given; F64 also of a body whose
 * F32 positions got an end in F64) and its end positions (no rows if it stands still). Valid until it is re-meshed or removed, or its edges
 * are set: its elements as they were given (U32), its edges (U32, 2 columns) and its faces (U32, 3 columns): those of tetrahedra are its
 * boundary, by tetrahedron and then by the opposite corner. INVALID: no such body, a scene that another call is changing. */
impinge_status impinge_scene_positions(const impinge_scene *scene, uint32_t body, impinge_array *view);
impinge_status impinge_scene_end_positions(const impinge_scene *scene, uint32_t body, impinge_array *view);
impinge_status impinge_scene_elements(const impinge_scene *scene, uint32_t body, impinge_array *view);
impinge_status impinge_scene_edges(const impinge_scene *scene, uint32_t body, impinge_array *view);
impinge_status impinge_scene_faces(const impinge_scene *scene, uint32_t body, impinge_array *view);

/* Finds vertices whose positions are equal (3 columns of F32 or F64), as along the seams of a mesh for drawing. `map` gets one number
 * per row: the vertex after welding. `firsts` gets one number per vertex after welding: the first row at its position; it has room
 * for as many numbers as there are rows, and may be NULL. `n_vertices` gets the number of vertices after welding.
 * Coordinates are compared as numbers, without a tolerance: -0 equals 0, an infinity equals itself, and NaN equals nothing, so a row with
 * NaN is never welded. Scenes refuse such positions; this does not. */
impinge_status impinge_weld(impinge_array positions, uint32_t *map, uint32_t *firsts, size_t *n_vertices);

/* ---- Queries ---- */

/* Kinds of pairs, as bits: vertices, edges and faces. The first letter is the element `a`. */
#define IMPINGE_VF 1
#define IMPINGE_EE 2
#define IMPINGE_EV 4
#define IMPINGE_VV 8
#define IMPINGE_EF 16
#define IMPINGE_FF 32

/* Pairs of one body that share vertices. RESOLVE: reported if they meet in more than the parts that they share; two faces, or two
 * tetrahedra, with the same vertices always, such as a face that is there twice. SKIP: not reported.
 * Pairs of edges or points, and all pairs of steps, candidates and near pairs, are not reported if they share a vertex. */
#define IMPINGE_SKIP 0
#define IMPINGE_RESOLVE 1

/* Pairs that touch at the start of a step. START_REPORT: reported with the time 0. START_SKIP: left out, whatever they do later.
 * START_VERIFY:
 * as START_REPORT, and the start is asked for intersections: a step that starts with any is not free, and none of it can be taken. */
#define IMPINGE_START_REPORT 0
#define IMPINGE_START_SKIP 1
#define IMPINGE_START_VERIFY 2

/* Flags of a query. DISTANCES and CLOSEST_POINTS: near pairs come with them. CELL: only pairs of the cell. SIGNED: not known to this
 * version; impinge_signed_distance has signs. */
#define IMPINGE_DISTANCES 1
#define IMPINGE_CLOSEST_POINTS 2
#define IMPINGE_SIGNED 4
#define IMPINGE_CELL 8

/* Which hits of a ray are sought: the first, whether there is any, or all. */
#define IMPINGE_HITS_FIRST 0
#define IMPINGE_HITS_ANY 1
#define IMPINGE_HITS_ALL 2

/* Pairs to leave out, before they are decided. Fields that a kind does not name are ignored.
 *   EXCLUDE_BODIES      the pairs of bodies `a` and `b`, or with a == b the self-collision of `a`
 *   EXCLUDE_RINGS       pairs of one body, whichever, that are near each other in its surface: some vertex of one element is at most `n`
 *                       edges, 0 to 16, away from some vertex of the other
 *   EXCLUDE_GROUPS      pairs of elements of the groups `a` and `b` of vertices, which impinge_scene_set_groups sets, or of one with
 *                       itself: each vertex of one element and each of the other must be in such groups. Several are one rule
 *                       about pairs of vertices: 0, 1 and 1, 2 leave out a vertex of group 1 with an edge of a vertex of group 0
 *                       and one of group 2, which neither leaves out alone
 *   EXCLUDE_VERTICES    pairs of an element of body `a` and one of body `b` of which some vertices are listed together: the list of vertex v
 *                       of `a` has the rows offsets[v] to offsets[v + 1] - 1 of `vertices`, vertices of `b`. Both have 1 column of any integer
 *                       type; `offsets` has one row more than `a` has vertices. With a == b these are pairs of that body, in either order.
 *                       Both arrays are copied
 * Pairs that are near at rest are left out by the field rest_pairs of impinge_query. */
#define IMPINGE_EXCLUDE_BODIES 0
#define IMPINGE_EXCLUDE_RINGS 1
#define IMPINGE_EXCLUDE_GROUPS 2
#define IMPINGE_EXCLUDE_VERTICES 3
typedef struct impinge_exclusion {
  uint32_t kind, a, b, n;
  impinge_array offsets, vertices;
} impinge_exclusion;

/* Sorted pairs of elements that are near each other. */
typedef struct impinge_near impinge_near;

/* The vertices of an element, in the order in which it names them, and its body. */
typedef struct impinge_element {
  const uint32_t *vertices;
  uint32_t n_vertices, body;
} impinge_element;

/* One query for all questions: fill it by impinge_query_default, then change fields. Where a query is an argument, NULL is the default one.
 *
 * Which pairs: a question that cannot honour one of these fields refuses it by name.
 *   between, self       1 or 0: pairs of different bodies, pairs of one body. Default: both.
 *   a, b                IMPINGE_ANY_BODY, or a body. Both: pairs between these two, whatever between, self and filters say. `a` alone:
 *                       pairs of `a` and any other, whatever filters say, its self-collision, or both, as between and self say.
 *   shared_vertex       Default: IMPINGE_RESOLVE.
 *   kinds               Bits of IMPINGE_VF ..., for steps (but EF and FF), candidates and near pairs. 0, the default: VF and EE; near pairs
 *                       also EF; EV where neither body has faces, VV where both are bodies of points.
 *   flags IMPINGE_CELL, cell_low, cell_high
 *                       Only the pairs of the half-open box [low, high): those for which it holds the larger of the lower
 *                       corners of the boxes of both elements, axis by axis. Cells that cover space have each pair once. Bounds may be
 * infinite.
 *   exclusions, n_exclusions
 *                       Pairs to leave out. They are read during the call. Nothing is proven of pairs that are left out: a step that is
 *                       free, or that impinge_truncate, impinge_advance or impinge_find_safe_distances allow, may take them through
 *                       each other.
 *   rest_pairs, n_rest_pairs
 *                       Answers of impinge_find_near whose pairs are left out: of the same scene, mostly at rest, with the kinds of
 *                       pairs that are to be left out, and found without pins and filters that would hide some. Those of another
 *                       scene are refused. Questions about the elements that bodies were given as leave out two of them if some
 *                       corners, edges or faces of theirs are such a pair.
 *   passes, passes_user Which pairs of elements may collide, of steps: 0 for those to leave out. It is asked about pairs that are in
 *                       contact, or might be, by several threads at the same time, and must always say the same of one pair. The first
 *                       element is the one that the kind of the pair names first. NULL, the default: all.
 * How: a question without use for one of these fields ignores it.
 *   start               IMPINGE_START_REPORT ...
 *   precision           IMPINGE_F32 (default) or IMPINGE_F64: that of times, which are rounded down.
 *   separation          A length, 0 or more: elements that are so near count as touching. Of steps. Thickness adds to it.
 *   clearance           A length, 0 or more: what a step leaves. A pair at the distance d at the start keeps
 *                       s + min(clearance, clearance_share * (d - s)), where s is separation plus the thickness of both elements.
 *   clearance_share     From 0 to less than 1. Default: 0.2.
 *   flags IMPINGE_DISTANCES, IMPINGE_CLOSEST_POINTS
 *                       Columns that near pairs come with.
 *   hits                IMPINGE_HITS_FIRST (default), IMPINGE_HITS_ANY or IMPINGE_HITS_ALL, of rays.
 *   fixed, n_fixed      Bodies that do not move, of safe distances: they leave the whole distance to what is near them. Steps
 *                       ignore it: what stands still there is a body without end positions.
 *   n_nearest           How many nearest elements of each point impinge_find_closest gives: at least 1. Default: 1. */
typedef struct impinge_query {
  uint32_t size; /* sizeof(impinge_query) of the caller */
  uint32_t between, self, shared_vertex;
  uint32_t a, b;
  uint32_t kinds, start, precision, hits, n_nearest, flags;
  double separation, clearance, clearance_share;
  double cell_low[3], cell_high[3];
  const impinge_exclusion *exclusions;
  size_t n_exclusions;
  const uint32_t *fixed;
  size_t n_fixed;
  int (*passes)(void *user, const impinge_element *a, const impinge_element *b);
  void *passes_user;
  const impinge_near *const *rest_pairs;
  size_t n_rest_pairs;
} impinge_query;

/* A query of a step: the same structure. */
typedef impinge_query impinge_step;

/* Fill in the defaults, and `size`. NULL is ignored. */
void impinge_query_default(impinge_query *query);
void impinge_step_default(impinge_step *step);

/* ---- Detectors ---- */

/* Finds pairs, question after question, and keeps what makes the next question about the same bodies fast. */
typedef struct impinge_detector impinge_detector;

/* Where the work is done. AUTO: a GPU if there is one, the library was built for it and it pays, else the CPU. It pays for steps, and for
 * frames after one with at least 50,000 pairs of boxes that overlap. */
#define IMPINGE_BACKEND_AUTO 0
#define IMPINGE_BACKEND_CPU 1
#define IMPINGE_BACKEND_GPU 2

/* How candidates are found. All methods give the same pairs. NAIVE compares every box with every box. */
#define IMPINGE_METHOD_AUTO 0
#define IMPINGE_METHOD_CLUSTERS 1
#define IMPINGE_METHOD_CELLS 2
#define IMPINGE_METHOD_NAIVE 3

/* Levels of the log. */
#define IMPINGE_LOG_ERROR 1
#define IMPINGE_LOG_INFO 2

/* The settings of a detector: fill them by impinge_settings_default, then change fields.
 *   backend, method     As above. Default: AUTO.
 *   threads             Threads of the CPU, 0 for one per core. With 1, no other thread is started.
 *   memory_budget       Bytes that the detector may hold, the answer included; 0, the default, for as many as it takes.
 *   max_pairs           The most pairs that an answer may have; 0, the default, for any number. More stop also impinge_count, and
 *                       impinge_find_candidates_in_runs where all of its runs together have more.
 *   cancelled           Called now and then during a question: anything but 0 stops it with IMPINGE_ERROR_CANCELLED. May be NULL.
 *   progress            Called now and then with units of work done and of all, which differ by stage. May be NULL.
 *   log                 Called with the message of every question that fails, and when a detector is opened: on which GPU, or on the CPU
 *                       and why, where IMPINGE_BACKEND_AUTO has chosen it. Not called with the message of a question that is refused because
 *                       the detector is in use, as another thread may be in these callbacks then. The text is valid during the call. May be
 *                       NULL.
 *   user                The first argument of these callbacks. They are called by the thread that asks. The detector is in use then, and so is
 *                       the scene: calls that would use the one, or change the other, are refused.
 *   device              Part of a GPU's name, to choose among several; NULL for any. It is copied. IMPINGE_BACKEND_AUTO of a library without
 *                       the GPU backend ignores it, which the log says.
 *   reuse_margin        For solvers that ask again and again while little moves. If it is above 0, questions about near pairs, neighbours and
 *                       safe distances list the pairs within their distance and this margin, and look at no others until some vertex has
 *                       moved farther than half of it, or anything but positions has changed. The answers are the same. After a list that
 *                       served no second question, the next is made when vertices have moved at most half of the margin between two.
 *                       Default: 0. */
typedef struct impinge_settings {
  uint32_t size; /* sizeof(impinge_settings) of the caller */
  uint32_t backend, method, threads;
  uint64_t memory_budget, max_pairs;
  int (*cancelled)(void *user);
  void *user;
  void (*progress)(void *user, uint64_t done, uint64_t total);
  void (*log)(void *user, uint32_t level, const char *message);
  const char *device;
  double reuse_margin;
} impinge_settings;

/* Fills in the defaults, and `size`. NULL is ignored. */
void impinge_settings_default(impinge_settings *settings);

/* Makes a detector. `settings` may be NULL for the default ones.
 * INVALID: a setting out of its range. DEVICE: no such GPU, or a library without the GPU backend. */
impinge_status impinge_detector_create(const impinge_settings *settings, impinge_detector **detector);

/* Ends a detector, but none that a call is using. Its own threads are told to end: some may run for a moment after this returns.
 * With `threads` 0 some are shared by all detectors of the process, and stay. */
void impinge_detector_destroy(impinge_detector *detector);

/* A GPU that can run the kernels of the library. Strings live as long as the list. */
typedef struct impinge_device {
  const char *name;           /* any part of it selects this device in impinge_settings */
  const char *interface_name; /* "vulkan", "metal" or "dx12" */
  const char *driver;         /* and its version */
  uint64_t max_binding;       /* the most bytes of one buffer binding */
  uint32_t is_software;       /* 1 if it runs on the CPU: IMPINGE_BACKEND_AUTO ignores such devices */
  uint32_t reserved;          /* 0 */
} impinge_device;

/* GPUs, hardware first. */
typedef struct impinge_devices impinge_devices;

/* The GPUs of this machine that can run the kernels of the library: none if it was built without the GPU backend. */
impinge_status impinge_find_devices(impinge_devices **devices);
/* How many there are, 0 for NULL; NULL if there are none. */
size_t impinge_devices_count(const impinge_devices *devices);
const impinge_device *impinge_devices_data(const impinge_devices *devices);
void impinge_devices_destroy(impinge_devices *devices);

/* ---- What answers are made of ---- */

/* Two elements: numbers of bodies, and of elements in their bodies. */
typedef struct impinge_pair {
  uint32_t body_a, element_a, body_b, element_b;
} impinge_pair;

/* Two elements that touch during a step. `toi` is the first time, rounded down; `kind` one of IMPINGE_VF ...; `at_start` 1 if they touch at
 * the
 * start, else 0. Vertices are numbered as positions are, faces as impinge_scene_faces, edges as impinge_scene_edges. */
typedef struct impinge_impact {
  double toi;
  uint32_t kind, body_a, element_a, body_b, element_b, at_start;
} impinge_impact;

/* The nearest two elements of two bodies. `distance` is rounded down, and 0 if and only if they touch, or are nearer than the smallest
 * double. Of several pairs whose distance is the same, rounded down, it is the lowest, by bodies and then by elements: not always the
 * nearest of them. `points`: one of each element, rounded. */
typedef struct impinge_nearest {
  double distance, points[2][3];
  uint32_t body_a, element_a, body_b, element_b;
} impinge_nearest;

/* A feature of an element: 0 to 2 a vertex, 8 to 10 an edge (from that vertex to the next), 16 the face, and NO_FEATURE where there is no
 * element. */
#define IMPINGE_NO_FEATURE 255

/* The number of no element: where nothing is near enough, or no tetrahedron contains a point. */
#define IMPINGE_NO_ELEMENT UINT32_C(0xffffffff)

/* The winding number of a point on the surface. */
#define IMPINGE_ON_SURFACE INT32_MIN

/* The element that is nearest to a point. Which it is, is decided exactly; of several at the same distance it is the lowest by body and
 * then by number. Without any that is near enough `found` is 0, `body` IMPINGE_ANY_BODY, `element` IMPINGE_NO_ELEMENT, `distance` infinity
 * and `point` NaN. */
typedef struct impinge_closest_element {
  double distance; /* rounded down: never above the true one, and 0 if they touch */
  double point[3]; /* the nearest point of the element, rounded: off by a few last bits of its largest coordinate */
  uint32_t body, element;
  uint32_t feature; /* which feature of the element has that point in its inside */
  uint32_t found;   /* 1, or 0 if nothing is near enough */
} impinge_closest_element;

/* Where a ray meets an element. */
typedef struct impinge_ray_hit {
  double t;               /* of the entry, in units of the direction, rounded down */
  double t_end;           /* where the ray leaves the element: more than t where it lies in the plane of the element */
  double barycentrics[3]; /* of the point of entry, each rounded to nearest */
  uint64_t ray;           /* its row */
  uint32_t body, element;
  uint32_t feature;       /* which feature of the element has the point of entry in its inside */
  uint32_t reserved;      /* 0 */
} impinge_ray_hit;

/* A connected region in which two bodies overlap: see impinge_find_penetration. Of a body that crosses itself, volume, area, normal, depth
 * and regions mean nothing. */
typedef struct impinge_region {
  double position[3];   /* the middle */
  double bounds[2][3];  /* the lowest and the highest coordinates */
  double length;        /* of the curves in which the surfaces cross */
  double patch_area;    /* of faces of both bodies in one plane */
  double area[3];       /* the area that the curves span, as a vector */
  double normal[3];     /* unit direction in which to push body_a so that the overlap shrinks fastest; zero if there is none */
  double depth;         /* the extent of the region along the normal: bodies pushed that far may still overlap; NaN if unknown */
  double volume;        /* of what the bodies have in common; NaN if they meet other than by edges that cross faces, as in one plane */
  uint32_t body_a, body_b;
  uint64_t n_contacts;  /* pairs in the region */
  uint64_t n_inside[2]; /* vertices of body_a inside body_b, and of body_b inside body_a */
} impinge_region;

/* Counts and times of an answer. Set `size`; the library fills as much as that. Strings live as long as the handle that was asked. */
typedef struct impinge_stats {
  uint32_t size;         /* sizeof(impinge_stats) of the caller */
  uint32_t n_threads;    /* threads used */
  double total_ms;       /* wall time of the question */
  uint64_t n_candidates; /* pairs whose boxes overlap */
  uint64_t n_unsure;     /* of these, left to exact arithmetic */
  uint64_t n_work_items; /* pairs of groups of elements */
  uint64_t n_clusters;   /* clusters of all bodies */
  uint64_t n_culled;     /* of these, proven apart from all other bodies */
  uint64_t n_clustered;  /* bodies clustered in this question */
  uint64_t n_batches;    /* parts in which the work was done */
  uint64_t n_reruns;     /* stages run again because a buffer had to grow */
  uint64_t bytes_held;   /* bytes that the detector held, the answer included */
  const char *backend;   /* "cpu", or the name of the GPU */
  const char *method;    /* "clusters", "cells", "naive", or empty */
} impinge_stats;

/* Columns of answers, as views without a copy that are valid as long as the answer. n is the number of pairs, impacts or contacts.
 *   KIND        n x 1 U8       one of IMPINGE_VF ...              near pairs, candidates; n x 1 U32 of impacts
 *   ROWS        n x 4 U32      body_a, element_a, body_b, element_b   all
 *   DISTANCE    n x 1 F64      with IMPINGE_DISTANCES or IMPINGE_CLOSEST_POINTS          near pairs
 *   POINTS      n x 6 F64      with IMPINGE_CLOSEST_POINTS: a point of a, one of b       near pairs
 *   FEATURES    n x 2 U8       the nearest feature of a and of b: 0 to 2 a vertex, 8 to 10 an edge (from that vertex to the next), 16 the
 * face
 *   PARALLEL    n x 1 U8       1 if there may be several nearest points                  near pairs
 *   TOI, AT_START  n x 1 F64, n x 1 U32                          impacts
 *   SHAPE       n x 1 U8       IMPINGE_SHAPE_... of each contact                          contacts
 *   STARTS      n + 1 x 1 U64  where the corners of each contact start                  contacts
 *   CORNERS     m x 1 U32      numbers of points                                        contacts
 *   CONTACT_POINTS p x 3 F64   where they are, each rounded to nearest                  contacts
 *   CURVE_STARTS c + 1 x 1 U64 where the points of each curve start                     contacts
 *   CURVE_POINTS k x 1 U32     numbers of points, along each curve                      contacts
 *   CURVE_CLOSED c x 1 U8      1 if it is a loop, which does not repeat its first point  contacts
 *   CURVE_LENGTH c x 1 F64     its length                                               contacts
 *   INSIDE_A, INSIDE_B  U32    vertices of the lower body inside the other, and of the other inside the lower, sorted  penetrations
 * Of the elements nearest to points, and of hits of rays, ROWS is n x 2 U32 (body, element), FEATURES n x 1 U32, and:
 *   DISTANCE, POINTS    n x 1, n x 3 F64                                                closest
 *   IS_HIT      r x 1 U8       of each ray: 1 if it hits anything                       hits
 *   STARTS      r + 1 x 1 U64  where the hits of each ray start, but for IMPINGE_HITS_ANY  hits
 *   T, T_END    n x 1 F64                                                               hits
 *   BARYCENTRICS n x 3 F64                                                              hits
 * Of stencils, KIND is n x 1 U8, FEATURES n x 2 U8 in the order of the vertices, and these, which are computed when first looked at,
 * on at most as many threads as the detector had that found the pairs:
 *   VERTICES    n x 4 U32      numbered through the scene, body after body
 *   STARTS      b + 1 x 1 U64  the number of the first vertex of each body, and the number of all
 *   WEIGHT      n x 1 F64      how many pairs it stands for, or the area at rest that they stand for
 *   COEFFICIENTS n x 4 F64     times the vertices they sum to the way between the nearest points
 *   SQUARED_DISTANCE, GRADIENT, HESSIAN        n x 1, n x 12, n x 144 F64: derivatives by x, y, z of the first vertex and so on
 *   MOLLIFIER, MOLLIFIER_GRADIENT, MOLLIFIER_HESSIAN   the same of the mollifier
 * Of changes, each column in ascending order:
 *   KEPT        n x 2 U64      the row in the old answer and the row in the new one
 *   NEW, GONE   n x 1 U64      rows of the new answer; rows of the old one */
#define IMPINGE_COLUMN_KIND 1
#define IMPINGE_COLUMN_ROWS 2
#define IMPINGE_COLUMN_DISTANCE 3
#define IMPINGE_COLUMN_POINTS 4
#define IMPINGE_COLUMN_FEATURES 5
#define IMPINGE_COLUMN_PARALLEL 6
#define IMPINGE_COLUMN_TOI 7
#define IMPINGE_COLUMN_AT_START 8
#define IMPINGE_COLUMN_SHAPE 9
#define IMPINGE_COLUMN_STARTS 10
#define IMPINGE_COLUMN_CORNERS 11
#define IMPINGE_COLUMN_CONTACT_POINTS 12
#define IMPINGE_COLUMN_CURVE_STARTS 13
#define IMPINGE_COLUMN_CURVE_POINTS 14
#define IMPINGE_COLUMN_CURVE_CLOSED 15
#define IMPINGE_COLUMN_CURVE_LENGTH 16
#define IMPINGE_COLUMN_INSIDE_A 17
#define IMPINGE_COLUMN_INSIDE_B 18
#define IMPINGE_COLUMN_IS_HIT 19
#define IMPINGE_COLUMN_T 20
#define IMPINGE_COLUMN_T_END 21
#define IMPINGE_COLUMN_BARYCENTRICS 22
#define IMPINGE_COLUMN_VERTICES 23
#define IMPINGE_COLUMN_WEIGHT 24
#define IMPINGE_COLUMN_COEFFICIENTS 25
#define IMPINGE_COLUMN_SQUARED_DISTANCE 26
#define IMPINGE_COLUMN_GRADIENT 27
#define IMPINGE_COLUMN_HESSIAN 28
#define IMPINGE_COLUMN_MOLLIFIER 29
#define IMPINGE_COLUMN_MOLLIFIER_GRADIENT 30
#define IMPINGE_COLUMN_MOLLIFIER_HESSIAN 31
#define IMPINGE_COLUMN_KEPT 32
#define IMPINGE_COLUMN_NEW 33
#define IMPINGE_COLUMN_GONE 34

/* The shape of a contact: a pair that is no pair of triangles; nothing, because bodies have moved since; a point; a segment; a polygon
 * of two triangles in one plane. */
#define IMPINGE_SHAPE_SOLID 0
#define IMPINGE_SHAPE_EMPTY 1
#define IMPINGE_SHAPE_POINT 2
#define IMPINGE_SHAPE_SEGMENT 3
#define IMPINGE_SHAPE_POLYGON 4

/* ---- Questions ----
 * All read the scene and change the detector. All may fail with any status: INVALID for a query that names no body of the scene, a
 * detector that is in use, or a scene that another call is changing; the others as the statuses say. After every failure but INTERNAL the
 * detector can be used again, and after INTERNAL if the message says that the scene is broken. Positions are checked when they are given or, of many that are lent, by the first question: answers about lent positions that have changed since mean nothing.
 *
 * Near pairs, neighbours, safe distances, candidates and steps are about vertices, edges and faces: those of a body of triangles are its
 * faces with their edges and vertices, of tetrahedra the same of their surface, of edges these with their vertices. Other vertices, such as
 * those of no face of a body of triangles, take no part. */

/* Sorted pairs of elements that intersect. */
typedef struct impinge_pairs impinge_pairs;

/* All pairs of elements, as bodies were given, that intersect at the positions of the scene. */
impinge_status impinge_detect(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query, impinge_pairs **pairs);

/* How many pairs impinge_detect would find. None of them is held. */
impinge_status impinge_count(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query, uint64_t *n);

/* Whether impinge_detect would find any: `any` gets 1 or 0. It ends with the first that is certain. */
impinge_status impinge_any(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query, int32_t *any);

/* Sorted pairs that touch during a step, with their times. */
typedef struct impinge_impacts impinge_impacts;

/* All pairs of vertices and faces, of edges and edges, and where bodies have no faces of edges and vertices, that touch during the step,
 * while vertices move on straight lines from their positions to their end positions. Vertices of no face of a body of triangles take no
 * part: nothing stops them. */
impinge_status impinge_find_impacts(impinge_detector *detector, const impinge_scene *scene, const impinge_step *step,
    impinge_impacts **impacts);

/* The first of them: `found` gets 1 and `impact` the impact, or 0 if nothing touches. Of several at the same time the first row. */
impinge_status impinge_find_earliest(impinge_detector *detector, const impinge_scene *scene, const impinge_step *step,
    impinge_impact *impact, int32_t *found);

/* Whether nothing touches during the step: `is_free` gets 1 or 0. If the start was free of intersections, so is every moment of a free
 * step; IMPINGE_START_VERIFY asks that too. */
impinge_status impinge_is_free(impinge_detector *detector, const impinge_scene *scene, const impinge_step *step, int32_t *is_free);

/* Positions to which a step can be taken. */
typedef struct impinge_motion impinge_motion;

/* How far the step can be taken: `fraction` gets a number from 0 to 1, for which the straight way to the rounded positions is free, if the
 * start was. `motion` gets these positions. Either may be NULL, but not both. With a clearance, the fraction also holds for positions
 * that the caller computes as
 * x0 + a * (x1 - x0) or x0 + a * dx, for every a up to it. Pairs that touch at the start allow no step, unless IMPINGE_START_SKIP leaves
 * them out.
 * INVALID: also the seams of a mesh that was not welded, where they allow no step, and a cell. */
impinge_status impinge_advance(impinge_detector *detector, const impinge_scene *scene, const impinge_step *step, double *fraction,
    impinge_motion **motion);

/* How far each vertex can go on its way to its end position: each stops for itself, where impinge_advance stops all at one fraction. The
 * straight way to the rounded positions is free in the sense of impinge_is_free, if the start was, but for pairs that touch at the start:
 * their vertices stay where they are, unless IMPINGE_START_SKIP leaves the pairs out, and are counted. Separation and clearance are kept at
 * every moment. A body whose end impinge_scene_set_end_transform made stops as a whole: all of its vertices go the least share of their ways
 * that one of them may go. INVALID: as impinge_advance. Found on the CPU. */
impinge_status impinge_truncate(impinge_detector *detector, const impinge_scene *scene, const impinge_step *step, impinge_motion **motion);

/* Sorted pairs whose boxes overlap. */
typedef struct impinge_candidates impinge_candidates;

/* Pairs of elements whose boxes over the whole step, each inflated by `inflation` on all sides, overlap. `inflation` is a length, 0 or
 * more. Of bodies that stand still: whose boxes overlap now. */
impinge_status impinge_find_candidates(impinge_detector *detector, const impinge_scene *scene, double inflation,
    const impinge_query *query, impinge_candidates **candidates);

/* The same in sorted runs of at most `most` pairs of one kind (IMPINGE_VF ...), for answers larger than memory. `each` gets one run after
 * the other, whose rows
 * are valid during the call; anything but 0 from it stops the search. `n` gets the number of pairs handed out and may be NULL. */
impinge_status impinge_find_candidates_in_runs(impinge_detector *detector, const impinge_scene *scene, double inflation,
    const impinge_query *query, uint64_t most,
                                               int (*each)(void *user, uint32_t kind, const impinge_pair *rows, size_t n), void *user,
    uint64_t *n);

/* Pairs of elements at most `distance` apart, a length of 0 or more, plus the thickness of both bodies; decided exactly, at the positions
 * of the scene. A pair of an edge and a face is reported if and only if the two meet, whatever `distance` is: otherwise a vertex and a face,
 * or two edges, of theirs are as near. Vertices of no face of a body of triangles take no part. */
impinge_status impinge_find_near(impinge_detector *detector, const impinge_scene *scene, double distance, const impinge_query *query,
    impinge_near **near_pairs);

/* How far each vertex may move. */
typedef struct impinge_safe_distances impinge_safe_distances;

/* How far each vertex may move, on any path, so that nothing touches: for each pair of elements that do not share a vertex, the largest
 * number of the vertices of one and the largest of the other add up to less than their distance, minus the thickness of both bodies. No
 * number is above `most`, a length of 0 or more. Pairs that touch get 0. Each number is rounded down, and the rounding of a new position
 * counts as motion. End positions are ignored. All pairs within twice `most` are looked at, so the time grows about with its square, and in
 * crowds with its cube: let it be no more than a vertex moves in one step. INVALID: also a body of `fixed` that is none of the scene. */
impinge_status impinge_find_safe_distances(impinge_detector *detector, const impinge_scene *scene, double most, const impinge_query *query,
    impinge_safe_distances **safe_distances);

/* Lists of what is near each element. */
typedef struct impinge_neighbours impinge_neighbours;

/* The pairs of impinge_find_near as lists: of each vertex the faces near it, of each face the vertices, of each edge the edges, and so on
 * for the kinds that the query asks for. */
impinge_status impinge_find_neighbours(impinge_detector *detector, const impinge_scene *scene, double distance, const impinge_query *query,
    impinge_neighbours **neighbours);

/* The smallest distance of two bodies: `found` gets 1 and `nearest` the pair that has it, or 0 if one body has no elements. Tetrahedra
 * are solid. */
impinge_status impinge_find_distance(impinge_detector *detector, const impinge_scene *scene, uint32_t a, uint32_t b,
    impinge_nearest *nearest, int32_t *found);

/* The two bodies that are nearest to each other of all that the query lets meet: `found` gets 1 and `nearest` the pair of elements that
 * has their distance, or 0 if there are no two that have elements. INVALID: also a query for self-collision, as the default one is (set
 * its field `self` to 0), or for the pairs of a cell. */
impinge_status impinge_find_nearest(impinge_detector *detector, const impinge_scene *scene, const impinge_query *query,
    impinge_nearest *nearest, int32_t *found);

/* Where points lie (3 columns of F32 or F64): `places` gets one number per row, 1 inside a body, 0 on its surface, -1 outside, decided
 * exactly. Triangles must be a closed surface, around which points are inside if it winds around them any number of times but 0; the
 * surface of tetrahedra is what impinge_scene_faces gives. Where tetrahedra overlap, a point strictly inside one of them is inside, also
 * on a face of another.
 * INVALID: also a body of points or edges, a surface that is not closed (the message names an edge), a point that is not finite. */
impinge_status impinge_contains(impinge_detector *detector, const impinge_scene *scene, uint32_t body, impinge_array points,
    int8_t *places);

/* How far points are from the surface of a body: `distances` gets one number per row, above 0 inside and below 0 outside. The sign is
 * exact, and the magnitude rounded down. Where tetrahedra overlap it is 0 also on a face that is strictly inside another one, where
 * impinge_contains says 1. INVALID: as impinge_contains. */
impinge_status impinge_signed_distance(impinge_detector *detector, const impinge_scene *scene, uint32_t body, impinge_array points,
    double *distances);

/* How often a closed surface of triangles winds around each point (3 columns of F32 or F64): `windings` gets one number per row, 0 outside,
 * 1 inside where faces are counterclockwise seen from outside and -1 where they are clockwise, and sums of these where the surface overlaps
 * itself; IMPINGE_ON_SURFACE on the surface. Decided exactly. INVALID: as impinge_contains; and a body of tetrahedra. */
impinge_status impinge_winding_numbers(impinge_detector *detector, const impinge_scene *scene, uint32_t body, impinge_array points,
    int32_t *windings);

/* Which tetrahedron of a body contains each point (3 columns of F32 or F64): `tetrahedra` gets one number per row, the lowest of several
 * that share the face, edge or vertex on which a point is, or IMPINGE_NO_ELEMENT outside. Tetrahedra are closed: points on the surface are
 * in one. Decided exactly. A flat one contains the points of its faces.
 * INVALID: also a body of another kind than tetrahedra, a point that is not finite. */
impinge_status impinge_locate(impinge_detector *detector, const impinge_scene *scene, uint32_t body, impinge_array points,
    uint32_t *tetrahedra);

/* The elements nearest to points, as many rows per point as the query says. */
typedef struct impinge_closest impinge_closest;

/* The element that is nearest to each point (3 columns of F32 or F64), if it is at most `most` away, a length of 0 or more, or infinity.
 * Elements are faces, those of the surface of tetrahedra, and the edges and points of other bodies. The query is about all bodies, or about
 * the body `a` alone. Its field `n_nearest` asks for that many elements of each point, nearest first, those at the same distance by body and
 * number. INVALID: also a query about pairs, n_nearest 0, a point that is not finite. */
impinge_status impinge_find_closest(impinge_detector *detector, const impinge_scene *scene, impinge_array points, double most,
    const impinge_query *query, impinge_closest **closest);

/* What rays hit, one ray after the other. */
typedef struct impinge_hits impinge_hits;

/* What each ray hits: the points origin + t direction for t from 0 to `most`, which is 1 for segments and infinity for rays. Origins and
 * directions have 3 columns of F32 or F64 and as many rows. Elements and the query are as for impinge_find_closest; its field `hits` asks
 * for the first hit, for any, or for all. A ray that grazes an edge or a vertex hits all elements there, and one in the plane of a face
 * hits it from an entry to an exit, decided exactly. The first hit is the one with the smallest t, of several the lowest by body and
 * number. A direction of zero is the origin alone. INVALID: also another number of directions than of origins, a number that is not finite. */
impinge_status impinge_cast(impinge_detector *detector, const impinge_scene *scene, impinge_array origins, impinge_array directions,
    double most, const impinge_query *query, impinge_hits **hits);

/* Where the triangles of each pair meet. */
typedef struct impinge_contacts impinge_contacts;

/* Where the triangles of each pair meet, and the curves in which surfaces cross. `pairs` are those of this scene at its positions.
 * Points are one if they have one name, by features: where a face is there twice, or faces of one body overlap in a plane, points and
 * curves double, and what they would connect can be several regions. */
impinge_status impinge_find_contacts(impinge_detector *detector, const impinge_scene *scene, const impinge_pairs *pairs,
    impinge_contacts **contacts);

/* How deep two closed bodies are in each other. */
typedef struct impinge_penetration impinge_penetration;

/* How deep two closed bodies of triangles are in each other, from contacts among which are all of these two.
 * INVALID: also a surface that is not closed, contacts without these two though they intersect, contacts of a query that left out pairs
 * of the two (in a cell, by groups or lists of vertices, or because faces of both were pinned), a body of the two that has moved or was
 * re-meshed since its contacts were found. */
impinge_status impinge_find_penetration(impinge_detector *detector, const impinge_scene *scene, const impinge_contacts *contacts,
    uint32_t a, uint32_t b, impinge_penetration **penetration);

/* Counts and times of the last question. INVALID: NULL, a size of 0, a detector that is in use. */
impinge_status impinge_detector_stats(const impinge_detector *detector, impinge_stats *stats);

/* Whether elements intersect at the start of the last step: 1 or 0, or -1 if nobody asked, which only IMPINGE_START_VERIFY does. -1 also
 * for NULL, and of a detector that is in use or broken. */
int32_t impinge_detector_start_intersects(const impinge_detector *detector);

/* ---- Answers ----
 * count: the number of rows; 0 for NULL. data: the rows, sorted; NULL if there are none. hash: a hash of the set, the same in every
 * language, which does not depend on order. It is of the numbers that rows and features have: of edges those of impinge_scene_set_edges,
 * where they were set. column: a view, see IMPINGE_COLUMN_...; INVALID: no such column.
 * stats: what the answer cost. */

size_t impinge_pairs_count(const impinge_pairs *pairs);
const impinge_pair *impinge_pairs_data(const impinge_pairs *pairs);
uint64_t impinge_pairs_hash(const impinge_pairs *pairs);
impinge_status impinge_pairs_column(const impinge_pairs *pairs, uint32_t column, impinge_array *view);
impinge_status impinge_pairs_stats(const impinge_pairs *pairs, impinge_stats *stats);
void impinge_pairs_destroy(impinge_pairs *pairs);

/* Sorted by kind, then by row. */
size_t impinge_impacts_count(const impinge_impacts *impacts);
const impinge_impact *impinge_impacts_data(const impinge_impacts *impacts);
uint64_t impinge_impacts_hash(const impinge_impacts *impacts);
impinge_status impinge_impacts_column(const impinge_impacts *impacts, uint32_t column, impinge_array *view);
impinge_status impinge_impacts_stats(const impinge_impacts *impacts, impinge_stats *stats);
/* Whether elements intersect at the start: 1 or 0, or -1 if nobody asked. */
int32_t impinge_impacts_start_intersects(const impinge_impacts *impacts);
void impinge_impacts_destroy(impinge_impacts *impacts);

/* Sorted by kind, then by row. */
size_t impinge_candidates_count(const impinge_candidates *candidates);
const impinge_pair *impinge_candidates_data(const impinge_candidates *candidates);
uint64_t impinge_candidates_hash(const impinge_candidates *candidates);
impinge_status impinge_candidates_column(const impinge_candidates *candidates, uint32_t column, impinge_array *view);
impinge_status impinge_candidates_stats(const impinge_candidates *candidates, impinge_stats *stats);
void impinge_candidates_destroy(impinge_candidates *candidates);

/* Sorted by kind, then by row. */
size_t impinge_near_count(const impinge_near *near_pairs);
const impinge_pair *impinge_near_data(const impinge_near *near_pairs);
uint64_t impinge_near_hash(const impinge_near *near_pairs);
impinge_status impinge_near_column(const impinge_near *near_pairs, uint32_t column, impinge_array *view);
impinge_status impinge_near_stats(const impinge_near *near_pairs, impinge_stats *stats);
void impinge_near_destroy(impinge_near *near_pairs);

/* Which rows two answers have in common. */
typedef struct impinge_changes impinge_changes;

/* Which pairs of an older answer the first one also has, which are new in it, and which are gone: what a solver keeps per pair moves with
 * it. Two pairs are the same if their kinds, bodies and elements are, whatever their times, features and distances. Pairs of a body that
 * was removed and of one that has its number now differ. INVALID: an older answer about another scene; both answers have pairs with
 * elements of the same sort (vertices, edges or faces) of a body that was re-meshed between them, or with edges of it that were set. */
impinge_status impinge_pairs_changes(const impinge_pairs *pairs, const impinge_pairs *old, impinge_changes **changes);
impinge_status impinge_impacts_changes(const impinge_impacts *impacts, const impinge_impacts *old, impinge_changes **changes);
impinge_status impinge_near_changes(const impinge_near *near_pairs, const impinge_near *old, impinge_changes **changes);
impinge_status impinge_changes_column(const impinge_changes *changes, uint32_t column, impinge_array *view);
void impinge_changes_destroy(impinge_changes *changes);

/* What a potential needs to know about near pairs: up to four vertices each, and how their squared distance depends on them. */
typedef struct impinge_stencils impinge_stencils;

/* One per near pair, in the same order, at the positions that the scene has now; the nearest features are those that were found. Vertices:
 * the vertex and three of the face, two of either edge (whichever is first), the vertex and two of the edge, two vertices. Where there are
 * fewer than four, the first is repeated, and coefficients and derivatives are 0 there. `rest` has the positions at rest of all vertices of
 * the scene, body after body (3 columns of F32 or F64): with it, the mollifier of nearly parallel edges is below 1. NULL: it is 1. It has as
 * many rows as all bodies of the scene together have vertices, those of the lowest body first, whatever bodies the pairs are of. If rows are
 * missing, the message names the first body without enough of them.
 * All numbers have the same bits on every machine. INVALID: pairs of IMPINGE_EF and IMPINGE_FF; pairs of another scene or of a body with new
 * elements; another number of rows; a scene that another call is changing. */
impinge_status impinge_near_stencils(const impinge_near *near_pairs, const impinge_scene *scene, const impinge_array *rest,
    impinge_stencils **stencils);
/* The same, weighted by area, so that a potential does not depend on how fine a mesh is. A pair of a vertex and a face weighs 1/4 of the area
 * of the vertex, of edges 1/4 of both areas, of an edge and a vertex 1/2 of that of the vertex, of vertices 1/2 of both. Areas are those of
 * ipc-toolkit's use_area_weighting, at rest: a third of each face at a vertex or beside an edge; without faces the length of an edge, and
 * half that of each edge at a vertex; 1 for a vertex alone. INVALID: also no `rest`. */
impinge_status impinge_near_stencils_by_area(const impinge_near *near_pairs, const impinge_scene *scene, const impinge_array *rest,
    impinge_stencils **stencils);
/* One per contact: features that several pairs share once, with the sum of their weights, sorted by kind and vertices. These are the
 * sets and weights of ipc-toolkit's NormalCollisions of type IPC. */
impinge_status impinge_stencils_merged(const impinge_stencils *stencils, impinge_stencils **merged);
size_t impinge_stencils_count(const impinge_stencils *stencils);
impinge_status impinge_stencils_column(const impinge_stencils *stencils, uint32_t column, impinge_array *view);
void impinge_stencils_destroy(impinge_stencils *stencils);
/* Replaces each of `n` symmetric matrices of `size` x `size` numbers (3, 6, 9 or 12), one after another, by the nearest one without
 * negative eigenvalues. Many are shared by as many threads as there are cores. The same bits on every machine and by any number of threads.
 * INVALID: another size, a number that is not finite; the matrices are as they were then. */
impinge_status impinge_project_psd(double *matrices, size_t n, size_t size);

/* How far each vertex of a body may move: a view, n x 1 F32 or F64 as its positions, valid as long as the answer. A vertex that belongs to
 * no element has `most`, as has each vertex of a body that the query is not about. INVALID: no such body when it was asked. */
impinge_status impinge_safe_distances_of(const impinge_safe_distances *safe_distances, uint32_t body, impinge_array *view);
/* The pairs at distance 0, or at most as far apart as their bodies are thick, also those of two fixed bodies, and those that are nearer
 * than the smallest double without touching. They belong to the answer: do not destroy them. NULL for NULL. */
const impinge_near *impinge_safe_distances_touching(const impinge_safe_distances *safe_distances);
impinge_status impinge_safe_distances_stats(const impinge_safe_distances *safe_distances, impinge_stats *stats);
void impinge_safe_distances_destroy(impinge_safe_distances *safe_distances);

/* How many pairs are near; each is in two lists. 0 for NULL. */
size_t impinge_neighbours_count(const impinge_neighbours *neighbours);
/* The lists number the vertices of all bodies one after another in the order of the bodies, and so the edges and the faces: `first` gets
 * the numbers of the first vertex, the first edge and the first face of a body. Edges have the caller's numbers, where these were set.
 * INVALID: no such body when it was asked. */
impinge_status impinge_neighbours_first(const impinge_neighbours *neighbours, uint32_t body, uint32_t (*first)[3]);
/* The lists of the elements that a kind (IMPINGE_VF ...) names first, or, if `reversed` is 1, of those that it names second: of IMPINGE_VF
 * the faces near each vertex, or the vertices near each face. The neighbours of element i are those from offsets[i] (U64) to
 * offsets[i + 1] of `indices` (U32), ascending; `distances` (F64) has how far each is, minus the thickness of both, rounded down: by at
 * most 2^-20 of it, or by 2^-1045, and 0 if and only if they touch, or are at most as far apart as they are thick, or farther by no more
 * than 2^-1045. Views, valid as long as the answer; each may be NULL. A kind that was not asked for has no offsets, or lists without entries. */
impinge_status impinge_neighbours_lists(const impinge_neighbours *neighbours, uint32_t kind, uint32_t reversed, impinge_array *offsets,
    impinge_array *indices, impinge_array *distances);
/* Writes these distances in single precision, rounded down once more, to memory of the caller, which has `room` for so many numbers.
 * INVALID: not for all of them, of which nothing is written then; the message says how many there are, as many as `indices` has rows. */
impinge_status impinge_neighbours_distances_f32(const impinge_neighbours *neighbours, uint32_t kind, uint32_t reversed,
    float *distances, size_t room);
impinge_status impinge_neighbours_stats(const impinge_neighbours *neighbours, impinge_stats *stats);
void impinge_neighbours_destroy(impinge_neighbours *neighbours);

/* The rows of the points, in their order: of point i those from i * n to (i + 1) * n, n being impinge_closest_n_nearest. Where fewer are
 * near enough, the last of them have `found` 0. The hash is of rows and their order. */
size_t impinge_closest_count(const impinge_closest *closest);
/* How many rows each point has: the field `n_nearest` of the query. 0 for NULL. */
size_t impinge_closest_n_nearest(const impinge_closest *closest);
const impinge_closest_element *impinge_closest_data(const impinge_closest *closest);
uint64_t impinge_closest_hash(const impinge_closest *closest);
impinge_status impinge_closest_column(const impinge_closest *closest, uint32_t column, impinge_array *view);
impinge_status impinge_closest_stats(const impinge_closest *closest, impinge_stats *stats);
void impinge_closest_destroy(impinge_closest *closest);

/* One row per hit, by ray, by t, then by body and number; none if only yes or no was asked for. */
size_t impinge_hits_count(const impinge_hits *hits);
const impinge_ray_hit *impinge_hits_data(const impinge_hits *hits);
/* How many rays there are; 0 for NULL. */
size_t impinge_hits_n_rays(const impinge_hits *hits);
uint64_t impinge_hits_hash(const impinge_hits *hits);
impinge_status impinge_hits_column(const impinge_hits *hits, uint32_t column, impinge_array *view);
impinge_status impinge_hits_stats(const impinge_hits *hits, impinge_stats *stats);
void impinge_hits_destroy(impinge_hits *hits);

/* One contact per row of the pairs. */
size_t impinge_contacts_count(const impinge_contacts *contacts);
const impinge_pair *impinge_contacts_data(const impinge_contacts *contacts);
/* The hash of the pairs. */
uint64_t impinge_contacts_hash(const impinge_contacts *contacts);
impinge_status impinge_contacts_column(const impinge_contacts *contacts, uint32_t column, impinge_array *view);
impinge_status impinge_contacts_stats(const impinge_contacts *contacts, impinge_stats *stats);
void impinge_contacts_destroy(impinge_contacts *contacts);

/* One row per region. */
size_t impinge_penetration_count(const impinge_penetration *penetration);
const impinge_region *impinge_penetration_data(const impinge_penetration *penetration);
impinge_status impinge_penetration_column(const impinge_penetration *penetration, uint32_t column, impinge_array *view);
impinge_status impinge_penetration_stats(const impinge_penetration *penetration, impinge_stats *stats);
/* The volume of all regions together; NaN if that of any is unknown. Infinite if larger than all floats, unknown if infinite regions cancel. */
double impinge_penetration_volume(const impinge_penetration *penetration);
void impinge_penetration_destroy(impinge_penetration *penetration);

/* The part of the step that can be taken: 1 for all of it, 0 for none, and for NULL. NaN of impinge_truncate, where each vertex has its
 * own. */
double impinge_motion_fraction(const impinge_motion *motion);
/* The first contact of the whole step: `found` gets 1 and `impact` the impact, or 0 if nothing touches. Whatever `precision` of the query
 * says, its time is rounded down to F64, so it may be later than that of impinge_find_earliest in F32. With a clearance it is the first time
 * at which a pair is as near as it may come, rounding included, as an F32: the pair that limits the step, also where nothing touches.
 * INVALID: of impinge_truncate. */
impinge_status impinge_motion_first(const impinge_motion *motion, impinge_impact *impact, int32_t *found);
/* Whether elements intersect at the start: 1 or 0, or -1 if nobody asked. */
int32_t impinge_motion_start_intersects(const impinge_motion *motion);
/* Of impinge_truncate: how many vertices were stopped before the end of their way; how many pairs touch at the start, or are at most as
 * far apart as they are to keep, without pairs of which no vertex moves; how often pairs were looked at again. 0 of impinge_advance, and
 * for NULL. */
uint64_t impinge_motion_n_cut(const impinge_motion *motion);
uint64_t impinge_motion_n_touching(const impinge_motion *motion);
uint32_t impinge_motion_rounds(const impinge_motion *motion);
/* Of impinge_truncate: the pairs that stopped vertices, those that touch at the start included, sorted by kind, then by row. They belong to
 * the caller, outlive the motion, and are sorted anew by each call; their stats are empty. INVALID: of impinge_advance. */
impinge_status impinge_motion_pairs(const impinge_motion *motion, impinge_candidates **pairs);
/* Where the vertices of a body are then: a view, valid as long as the motion. No rows for a body that stands still. INVALID: no such body
 * when the step was asked about. */
impinge_status impinge_motion_positions(const impinge_motion *motion, uint32_t body, impinge_array *view);
/* Takes the step: the bodies that move get these positions, and stand still until they get end positions again. Transforms of bodies whose
 * end impinge_scene_set_end_transform set go on from the same positions as before; those of others start from these.
 * INVALID: a body that has other positions than when the step was found, also one that does not move: nothing would be known of the step.
 * A body that is new, or that moves and was removed. The scene is unchanged then. */
impinge_status impinge_motion_apply(const impinge_motion *motion, impinge_scene *scene);
impinge_status impinge_motion_stats(const impinge_motion *motion, impinge_stats *stats);
void impinge_motion_destroy(impinge_motion *motion);

/* ---- Hashes ----
 * The hash of rows from elsewhere: equal to that of an answer with the same rows. The order of rows does not matter; the lower (body,
 * element) comes first in each. 0 for no rows. */
uint64_t impinge_hash_pairs(const impinge_pair *rows, size_t n);
uint64_t impinge_hash_impacts(const impinge_impact *rows, size_t n);

/* ---- One pair of elements ---- */

/* The first time at which two elements touch that no scene holds. `kind` is IMPINGE_VF, IMPINGE_EE, IMPINGE_EV or IMPINGE_VV; `start` and
 * `end` have one row per vertex (3 columns of F32 or F64), those of `a` first. separation and clearance are those of `query`, other fields
 * of it are ignored. `found` gets 1 and `toi` the first time, rounded down to F64, or 0 if they do not touch.
 * INVALID: a position that is not finite, another number of rows. */
impinge_status impinge_first_contact(uint32_t kind, impinge_array start, impinge_array end, const impinge_step *query, double *toi,
    int32_t *found);

#ifdef __cplusplus
}
#endif

#endif /* IMPINGE_H */
