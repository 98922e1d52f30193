/* What a ROS 2 node does on DDS, by another maker's DDS: topics and types are named as ROS 2 names
 * them, its QoS is ROS 2's default (reliable, volatile, the last 10), no partition is set, and
 * nothing of Trammel's contract is known. Prints how the server names its endpoints, asks where the
 * tool will be, and has that pose corrected. Usage: ros2_node DOMAIN CELL [LIMIT_S]. The network is
 * set by CYCLONEDDS_URI. */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "trammel_msgs.h"

#define JOINTS 6

static dds_duration_t limit = DDS_SECS(20);
static char empty[1] = "";

static int fail(const char* what) {
  fprintf(stderr, "ros2_node: %s\n", what);
  return 1;
}

/* rmw_qos_profile_default */
static dds_qos_t* default_qos(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_INFINITY);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
  return qos;
}

/* Until the entity has one of the states of `mask`. */
static int wait_for(dds_entity_t participant, dds_entity_t entity, uint32_t mask) {
  const dds_entity_t waitset = dds_create_waitset(participant);
  dds_set_status_mask(entity, mask);
  dds_waitset_attach(waitset, entity, 0);
  const dds_return_t triggered = dds_waitset_wait(waitset, NULL, 0, limit);
  dds_delete(waitset);
  return triggered > 0;
}

/* A publisher of questions and a subscription to answers, as a node has them. */
struct call {
  dds_entity_t writer, reader;
};

static int open_call(dds_entity_t participant, struct call* call,
                     const dds_topic_descriptor_t* question, const char* question_topic,
                     const dds_topic_descriptor_t* answer, const char* answer_topic) {
  const dds_entity_t asked = dds_create_topic(participant, question, question_topic, NULL, NULL);
  const dds_entity_t told = dds_create_topic(participant, answer, answer_topic, NULL, NULL);
  call->writer = dds_create_writer(participant, asked, default_qos(), NULL);
  call->reader = dds_create_reader(participant, told, default_qos(), NULL);
  if (call->writer < 0 || call->reader < 0) return fail("no endpoints");
  dds_publication_matched_status_t there;
  dds_subscription_matched_status_t back;
  if (dds_get_publication_matched_status(call->writer, &there) != DDS_RETCODE_OK)
    return fail("no match status");
  if (there.current_count == 0 &&
      !wait_for(participant, call->writer, DDS_PUBLICATION_MATCHED_STATUS)) {
    return fail("nobody subscribes to questions");
  }
  if (dds_get_subscription_matched_status(call->reader, &back) != DDS_RETCODE_OK)
    return fail("no match status");
  if (back.current_count == 0 &&
      !wait_for(participant, call->reader, DDS_SUBSCRIPTION_MATCHED_STATUS)) {
    return fail("nobody publishes answers");
  }
  return 0;
}

/* How the server that reads what `writer` writes names topic and type. */
static int print_names(dds_entity_t writer) {
  dds_instance_handle_t reader;
  if (dds_get_matched_subscriptions(writer, &reader, 1) != 1) return fail("not one server");
  dds_builtintopic_endpoint_t* names = dds_get_matched_subscription_data(writer, reader);
  if (names == NULL) return fail("no names");
  printf("%s %s\n", names->topic_name, names->type_name);
  dds_builtintopic_free_endpoint(names);
  return 0;
}

static void* take_one(dds_entity_t participant, dds_entity_t reader) {
  void* samples[1] = {NULL};
  dds_sample_info_t info;
  while (wait_for(participant, reader, DDS_DATA_AVAILABLE_STATUS)) {
    if (dds_take(reader, samples, &info, 1, 1) == 1 && info.valid_data) return samples[0];
  }
  return NULL;
}

static const trammel_msgs_msg_dds__PredictedErrors_* predict(dds_entity_t participant,
                                                             const struct call* call, char* id,
                                                             char* cell, double* joints,
                                                             uint32_t count) {
  trammel_msgs_msg_dds__PredictErrors_ question;
  memset(&question, 0, sizeof question);
  question.id = id;
  question.server = question.tool = question.payload = empty;
  question.cell = cell;
  question.joints = count;
  question.joints_rad._maximum = question.joints_rad._length = JOINTS;
  question.joints_rad._buffer = joints;
  if (dds_write(call->writer, &question) != DDS_RETCODE_OK) return NULL;
  return take_one(participant, call->reader);
}

static int correct(dds_entity_t participant, const struct call* call, char* cell,
                   geometry_msgs_msg_dds__Pose_* wanted, double* joints) {
  trammel_msgs_msg_dds__CorrectTargets_ question;
  memset(&question, 0, sizeof question);
  question.id = "node-1/3";
  question.server = question.tool = question.payload = empty;
  question.cell = cell;
  question.poses._maximum = question.poses._length = 1;
  question.poses._buffer = wanted;
  question.joints = JOINTS;
  question.joints_rad._maximum = question.joints_rad._length = JOINTS;
  question.joints_rad._buffer = joints;
  if (dds_write(call->writer, &question) != DDS_RETCODE_OK) return fail("cannot write");
  const trammel_msgs_msg_dds__CorrectedTargets_* answer = take_one(participant, call->reader);
  if (answer == NULL || answer->commanded._length != 1) return fail("no correction");
  printf("id=%s result=%u status=%u joints=%u x_m=%+.6f before_m=%.6f after_m=%.6f\n", answer->id,
         answer->result, answer->status._buffer[0], answer->joints_rad._length,
         answer->commanded._buffer[0].position.x - wanted->position.x,
         answer->error_before_m._buffer[0], answer->error_after_m._buffer[0]);
  return 0;
}

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) return fail("usage: ros2_node DOMAIN CELL [LIMIT_S]");
  if (argc == 4) limit = DDS_SECS(atoi(argv[3]));
  if (getenv("CYCLONEDDS_URI") == NULL)
    return fail("CYCLONEDDS_URI must hold the loopback profile");
  const dds_entity_t participant =
      dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  if (participant < 0) return fail("no participant");
  struct call predictions, corrections;
  if (open_call(participant, &predictions, &trammel_msgs_msg_dds__PredictErrors__desc,
                "rt/trammel/predict_errors", &trammel_msgs_msg_dds__PredictedErrors__desc,
                "rt/trammel/predicted_errors") != 0) {
    return 1;
  }
  if (open_call(participant, &corrections, &trammel_msgs_msg_dds__CorrectTargets__desc,
                "rt/trammel/correct_targets", &trammel_msgs_msg_dds__CorrectedTargets__desc,
                "rt/trammel/corrected_targets") != 0) {
    return 1;
  }
  if (print_names(predictions.writer) != 0 || print_names(corrections.writer) != 0) return 1;

  double joints[JOINTS] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  const trammel_msgs_msg_dds__PredictedErrors_* told =
      predict(participant, &predictions, "node-1/1", argv[2], joints, JOINTS);
  if (told == NULL || told->predicted._length != 1) return fail("no prediction");
  geometry_msgs_msg_dds__Pose_ wanted = told->nominal._buffer[0];
  printf("id=%s server=%s result=%u version=%d dx_m=%.7f\n", told->id, told->server, told->result,
         told->model_version, told->predicted._buffer[0].position.x - wanted.position.x);
  const trammel_msgs_msg_dds__PredictedErrors_* refused =
      predict(participant, &predictions, "node-1/2", argv[2], joints, 5);
  if (refused == NULL) return fail("no refusal");
  printf("result=%u: %s\n", refused->result, refused->message);
  const int failed = correct(participant, &corrections, argv[2], &wanted, joints);
  dds_delete(participant);
  return failed;
}
