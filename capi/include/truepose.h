/* truepose: takes the geometric and non-geometric errors of a robot arm out of its joint
 * commands, in the control loop.
 *
 *     static struct truepose_compensator arm;              // zero, and stays where it is
 *     if (truepose_init(&arm, blob, blob_length) != TRUEPOSE_OK) { ... }
 *     for (;;) {                                           // the 1 kHz control task
 *         struct truepose_request request;
 *         struct truepose_outcome outcome;
 *         truepose_request_default(&request);
 *         memcpy(request.q, nominal_joints, truepose_joints() * sizeof(float));
 *         truepose_correct(&arm, &request, &budget, &outcome);
 *         send(outcome.q);                                 // always safe to send
 *     }
 *
 * SI units: m, rad, kg, s; temperatures in degC. Single precision. Nothing is allocated and
 * nothing has to be freed. Every function returns at once with an error code where a pointer is
 * null; other pointers it takes at their word. No function keeps a pointer that it was given,
 * except truepose_init the one to the blob, as long as the compensator is used.
 */

#ifndef TRUEPOSE_H
#define TRUEPOSE_H

/* Written from capi/src by `cargo run -p truepose-capi --example write_header`. */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Most joints that any build of the library has.
#define TRUEPOSE_MAX_JOINTS 12

// Temperature sensors.
#define TRUEPOSE_MAX_SENSORS 8

// Size of a `truepose_compensator` in words of 8 bytes, for the largest build.
#define TRUEPOSE_WORDS 1088

// What a function answers. Zero is success; every other one says why nothing was done.
typedef enum truepose_error {
  // Done.
  TRUEPOSE_OK = 0,
  // A pointer is null.
  TRUEPOSE_NULL_POINTER = 1,
  // `truepose_init` was not called, or refused its blob.
  TRUEPOSE_NOT_READY = 2,
  // The bytes are not a blob, or one that is cut short or has something behind it.
  TRUEPOSE_BLOB_NOT_ONE = 3,
  // The blob has been altered: its checksum is wrong.
  TRUEPOSE_BLOB_CHECKSUM = 4,
  // The blob's layout is newer or older than what this version reads.
  TRUEPOSE_BLOB_LAYOUT = 5,
  // The blob is for an arm with another number of joints than `truepose_joints`.
  TRUEPOSE_BLOB_JOINTS = 6,
  // The blob's body does not follow its layout.
  TRUEPOSE_BLOB_BODY = 7,
  // The blob holds values that cannot be meant.
  TRUEPOSE_BLOB_VALUES = 8,
} truepose_error;

// Why a correction ended as it did. The joints are safe to send in every case.
typedef enum truepose_status {
  // The predicted pose error is below both tolerances.
  TRUEPOSE_CONVERGED = 0,
  // Nothing more to gain: held by limits, by the correction bound, by a singularity, or the
  // next step would be below the joints' resolution.
  TRUEPOSE_SETTLED = 1,
  // The iterations allowed are used up.
  TRUEPOSE_ITERATION_LIMIT = 2,
  // Another iteration does not fit into the budget.
  TRUEPOSE_OUT_OF_BUDGET = 3,
  // Refused, the nominal command goes out: NaN or infinity in directions or payload.
  TRUEPOSE_CONDITIONS_NOT_FINITE = 4,
  // Refused, the nominal command goes out: the pose is not finite or its rotation not one.
  TRUEPOSE_NOT_A_POSE = 5,
  // Refused, the nominal command goes out: the model gives no finite pose for it.
  TRUEPOSE_PREDICTION_NOT_FINITE = 6,
  // Refused, the last command goes out again: NaN or infinity in the nominal joints.
  TRUEPOSE_JOINTS_NOT_FINITE = 7,
  // Refused, the nominal command goes out: it is outside the region that the method was
  // taught on.
  TRUEPOSE_OUTSIDE_REGION = 8,
  // Refused, the nominal command goes out: the blob has no tables for this method.
  TRUEPOSE_NOT_TAUGHT = 9,
} truepose_status;

// A compensator with its model. Room for it is the caller's: a static variable, or a local one
// that lives long enough. Set it to zero before `truepose_init`.
//
// Once it is ready it may not be moved or copied: it points into itself. There is nothing to
// free; it ends when its memory is used for something else. Several may be used side by side;
// one must not be used by two tasks at a time.
typedef struct truepose_compensator {
  // Not for the caller.
  uint64_t inside[TRUEPOSE_WORDS];
} truepose_compensator;

// A pose in the world.
typedef struct truepose_pose {
  // Rotation by rows: columns are the tool's axes.
  float rotation[3][3];
  // m.
  float translation[3];
} truepose_pose;

// What is known besides the joints.
typedef struct truepose_conditions {
  // Sign of the last move of each joint: -1, 0 (not known) or 1.
  float direction[TRUEPOSE_MAX_JOINTS];
  // kg beyond the flange, the tool's own mass excluded.
  float payload;
  // Its centre of mass in the tool frame, m.
  float payload_com[3];
  // degC, one a sensor; NaN where it is not known, which switches its effects off.
  float temperature[TRUEPOSE_MAX_SENSORS];
  // s since the start of the measurements; NaN where it is not known, likewise.
  float time;
} truepose_conditions;

// What to correct. Start from `truepose_request_default`.
typedef struct truepose_request {
  // Nominal joint command, rad or m, in the first `truepose_joints()` places.
  float q[TRUEPOSE_MAX_JOINTS];
  // Whether `pose` is to be reached. If not: the pose that `q` nominally means.
  bool has_pose;
  // Tool pose to reach in the world.
  struct truepose_pose pose;
  // What is known besides.
  struct truepose_conditions conditions;
} truepose_request;

// How long a correction may take.
typedef struct truepose_budget {
  // Reads a counter that counts up and wraps at 32 bits, such as DWT_CYCCNT. Null: a clock
  // that stands still.
  uint32_t (*now)(void *context);
  // Handed to `now`; may be null.
  void *context;
  // Counts that may pass.
  uint32_t cycles;
} truepose_budget;

// What goes out.
typedef struct truepose_outcome {
  // Joint command to send, rad or m, in the first `truepose_joints()` places; the rest zero.
  float q[TRUEPOSE_MAX_JOINTS];
  // Why it is as it is.
  enum truepose_status status;
  // Steps that were evaluated.
  uint8_t iterations;
  // Whether a task point came out: from the task-point method only.
  bool has_task_point;
  // The pose to ask of the nominal inverse kinematics in place of the desired one.
  struct truepose_pose task_point;
  // Predicted error of the nominal command: m, rad. NaN where it was not computed.
  float initial[2];
  // Predicted error of `q`: m, rad. NaN where it was not computed.
  float remaining[2];
  // Joints that stand at a limit or at the correction bound.
  bool clamped[TRUEPOSE_MAX_JOINTS];
  // Counts spent, by the budget's clock.
  uint32_t cycles;
} truepose_outcome;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Number of joints that this build of the library is for.
size_t truepose_joints(void);

// Reads a blob and makes `arm` ready. The blob is checked first: if it is refused, `arm`
// stays as it was, ready with its old blob or not ready.
//
// `arm`: all zero, or ready. `blob`: `length` bytes of a `.tpb` file, anywhere in memory,
// flash for instance; tables are read in place, so they have to stay there unchanged as long
// as `arm` is used.
//
// # Safety
// As above; nobody else uses `arm` meanwhile.
enum truepose_error truepose_init(struct truepose_compensator *arm,
                                  const uint8_t *blob,
                                  size_t length);

// Forgets what was remembered from the cycle before: the next request is answered as the
// first one.
//
// # Safety
// `arm`: made by `truepose_init`, not moved since, used by nobody else meanwhile.
enum truepose_error truepose_reset(struct truepose_compensator *arm);

// Fills `request` with a joint command without a pose, under conditions of which nothing is
// known: no load, temperatures and time not a number.
//
// # Safety
// `request`: to write to.
enum truepose_error truepose_request_default(struct truepose_request *request);

// The corrected command for `request` within `budget` goes to `outcome`, whose joints are
// always safe to send. No allocation, no panic; time: `docs/COST.md`.
//
// `budget`: null if there is no deadline.
//
// # Safety
// `arm`: made by `truepose_init`, not moved since, used by nobody else meanwhile. `request`
// and `budget` (or null): to read. `outcome`: to write to; it may not overlap the others.
enum truepose_error truepose_correct(struct truepose_compensator *arm,
                                     const struct truepose_request *request,
                                     const struct truepose_budget *budget,
                                     struct truepose_outcome *outcome);

// Where the arm as it was identified has its tool at the joint readings `q` (rad or m).
//
// # Safety
// `arm`: made by `truepose_init`, not moved since. `q`: `truepose_joints` values.
// `conditions`: to read. `pose`: to write to.
enum truepose_error truepose_predict(const struct truepose_compensator *arm,
                                     const float *q,
                                     const struct truepose_conditions *conditions,
                                     struct truepose_pose *pose);

// Where the controller's own kinematics put the tool at the joint command `q` (rad or m).
//
// # Safety
// `arm`: made by `truepose_init`, not moved since. `q`: `truepose_joints` values.
// `pose`: to write to.
enum truepose_error truepose_nominal_pose(const struct truepose_compensator *arm,
                                          const float *q,
                                          struct truepose_pose *pose);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TRUEPOSE_H */
