/* A client built with another maker's DDS from the same IDL. Waits for a server's status, asks it
 * for one prediction, has the nominal pose of these joints corrected, and prints all three. POSES:
 * asks for the prediction as often, in one request. Usage: cyclone_client DOMAIN CELL [LIMIT_S
 * [POSES]]. The network is set by CYCLONEDDS_URI. */
#include <dds/dds.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "correct_target.h"
#include "predict_error.h"
#include "state.h"

#define PARTITION "cyclone-1"
#define SEQUENCE_NUMBER 4711

static dds_duration_t limit = DDS_SECS(20);

static int fail(const char* what) {
  fprintf(stderr, "cyclone_client: %s\n", what);
  return 1;
}

static dds_qos_t* call_qos(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 64);
  return qos;
}

static dds_qos_t* state_qos(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
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

/* One valid sample, or NULL when none comes. */
static void* take_one(dds_entity_t participant, dds_entity_t reader) {
  void* samples[1] = {NULL};
  dds_sample_info_t info;
  while (wait_for(participant, reader, DDS_DATA_AVAILABLE_STATUS)) {
    if (dds_take(reader, samples, &info, 1, 1) == 1 && info.valid_data) return samples[0];
  }
  return NULL;
}

/* Until both endpoints are matched with the server. */
static int wait_for_server(dds_entity_t participant, dds_entity_t writer, dds_entity_t reader) {
  dds_publication_matched_status_t there;
  if (dds_get_publication_matched_status(writer, &there) != DDS_RETCODE_OK)
    return fail("no match status");
  if (there.current_count == 0 && !wait_for(participant, writer, DDS_PUBLICATION_MATCHED_STATUS)) {
    return fail("no server reads requests");
  }
  dds_subscription_matched_status_t back;
  if (dds_get_subscription_matched_status(reader, &back) != DDS_RETCODE_OK)
    return fail("no match status");
  if (back.current_count == 0 && !wait_for(participant, reader, DDS_SUBSCRIPTION_MATCHED_STATUS)) {
    return fail("no server writes replies");
  }
  return 0;
}

/* The header and the context of a request by `writer`. */
static void begin(trammel_wire_v2_RequestHeader* header, trammel_wire_v2_Context* about,
                  const dds_guid_t* writer, const char* server, char* cell) {
  static char empty[1] = "";
  memcpy(header->request_id.writer_guid, writer->v, sizeof header->request_id.writer_guid);
  header->request_id.sequence_number = SEQUENCE_NUMBER;
  strcpy(header->server, server);
  strcpy(header->reply_partition, PARTITION);
  strcpy(header->trace_id, "trace-7");
  header->deadline_ms = 5000;
  header->contract_version = trammel_wire_v2_CONTRACT_VERSION;
  about->cell = cell;
  about->tool = empty;
  about->payload = empty;
  about->model = empty;
}

/* What must be commanded so that the tool lands on `wanted`, on the branch of the joints. */
static int correct(dds_entity_t participant, dds_entity_t subscriber, const char* server,
                   char* cell, const trammel_wire_v2_PoseMm* wanted,
                   const trammel_wire_v2_CommandedJoints* near) {
  const dds_entity_t request_topic =
      dds_create_topic(participant, &trammel_wire_v2_CorrectTargetRequest_desc,
                       "CorrectTarget_2_Request", NULL, NULL);
  const dds_entity_t reply_topic = dds_create_topic(
      participant, &trammel_wire_v2_CorrectTargetReply_desc, "CorrectTarget_2_Reply", NULL, NULL);
  const dds_entity_t reader = dds_create_reader(subscriber, reply_topic, call_qos(), NULL);
  const dds_entity_t writer = dds_create_writer(participant, request_topic, call_qos(), NULL);
  dds_guid_t guid;
  if (reader < 0 || writer < 0 || dds_get_guid(writer, &guid) != DDS_RETCODE_OK)
    return fail("no endpoints");
  if (wait_for_server(participant, writer, reader) != 0) return 1;

  trammel_wire_v2_Target target;
  memset(&target, 0, sizeof target);
  target.kind = trammel_wire_v2_TARGET_POSE_NEAR_JOINTS;
  target.pose = *wanted;
  target.joints_rad = near->joints_rad;
  target.approach = near->approach;
  trammel_wire_v2_CorrectTargetRequest request;
  memset(&request, 0, sizeof request);
  begin(&request.header, &request.about, &guid, server, cell);
  request.targets._maximum = request.targets._length = 1;
  request.targets._buffer = &target;
  if (dds_write(writer, &request) != DDS_RETCODE_OK) return fail("cannot write the request");
  const trammel_wire_v2_CorrectTargetReply* reply = take_one(participant, reader);
  if (reply == NULL) return fail("no reply");
  if (reply->corrections._length != 1) return fail("no correction");
  const trammel_wire_v2_CorrectedTarget* corrected = &reply->corrections._buffer[0];
  printf("status=%d x_mm=%+.3f before_mm=%.3f after_mm=%.3f\n", (int)corrected->status,
         corrected->commanded.x_mm - wanted->x_mm, corrected->error_before_mm,
         corrected->error_after_mm);
  return 0;
}

int main(int argc, char** argv) {
  if (argc < 3 || argc > 5) return fail("usage: cyclone_client DOMAIN CELL [LIMIT_S [POSES]]");
  if (argc > 3) limit = DDS_SECS(atoi(argv[3]));
  const uint32_t poses = argc > 4 ? (uint32_t)atoi(argv[4]) : 1;
  /* Without it Cyclone DDS would speak on every interface; with it, on the loopback profile that it
   * holds. */
  if (getenv("CYCLONEDDS_URI") == NULL)
    return fail("CYCLONEDDS_URI must hold the loopback profile");
  const dds_entity_t participant =
      dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  if (participant < 0) return fail("no participant");

  const dds_entity_t status_topic = dds_create_topic(
      participant, &trammel_wire_v2_ServiceStatus_desc, "ServiceStatus_2", NULL, NULL);
  const dds_entity_t model_topic =
      dds_create_topic(participant, &trammel_wire_v2_ModelStatus_desc, "ModelStatus_2", NULL, NULL);
  const dds_entity_t request_topic = dds_create_topic(
      participant, &trammel_wire_v2_PredictErrorRequest_desc, "PredictError_2_Request", NULL, NULL);
  const dds_entity_t reply_topic = dds_create_topic(
      participant, &trammel_wire_v2_PredictErrorReply_desc, "PredictError_2_Reply", NULL, NULL);
  const dds_entity_t status_reader =
      dds_create_reader(participant, status_topic, state_qos(), NULL);
  const dds_entity_t model_reader = dds_create_reader(participant, model_topic, state_qos(), NULL);
  const char* partitions[1] = {PARTITION};
  dds_qos_t* subscriber_qos = dds_create_qos();
  dds_qset_partition(subscriber_qos, 1, partitions);
  const dds_entity_t subscriber = dds_create_subscriber(participant, subscriber_qos, NULL);
  const dds_entity_t reply_reader = dds_create_reader(subscriber, reply_topic, call_qos(), NULL);
  const dds_entity_t request_writer =
      dds_create_writer(participant, request_topic, call_qos(), NULL);
  if (status_reader < 0 || model_reader < 0 || reply_reader < 0 || request_writer < 0)
    return fail("no endpoints");

  const trammel_wire_v2_ServiceStatus* status = take_one(participant, status_reader);
  if (status == NULL) return fail("no ServiceStatus");
  printf("server=%s contract=%u cells=%u\n", status->server, status->contract_version,
         status->cells._length);
  const trammel_wire_v2_ModelStatus* in_force = take_one(participant, model_reader);
  if (in_force == NULL) return fail("no ModelStatus");
  printf("cell=%s version=%d\n", in_force->cell, in_force->model.version);

  if (wait_for_server(participant, request_writer, reply_reader) != 0) return 1;

  double values[6] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  trammel_wire_v2_CommandedJoints pose;
  memset(&pose, 0, sizeof pose);
  pose.joints_rad._maximum = pose.joints_rad._length = 6;
  pose.joints_rad._buffer = values;
  pose.approach.temperature_c = pose.approach.time_s = NAN;
  dds_guid_t guid;
  if (dds_get_guid(request_writer, &guid) != DDS_RETCODE_OK) return fail("the writer has no GUID");
  trammel_wire_v2_PredictErrorRequest request;
  memset(&request, 0, sizeof request);
  begin(&request.header, &request.about, &guid, status->server, argv[2]);
  request.poses._maximum = request.poses._length = poses;
  request.poses._buffer = dds_alloc(poses * sizeof pose);
  for (uint32_t i = 0; i < poses; ++i) request.poses._buffer[i] = pose;
  if (dds_write(request_writer, &request) != DDS_RETCODE_OK)
    return fail("cannot write the request");

  const trammel_wire_v2_PredictErrorReply* reply = take_one(participant, reply_reader);
  if (reply == NULL) return fail("no reply");
  const int is_ours =
      memcmp(reply->header.related_request_id.writer_guid, guid.v, sizeof guid.v) == 0;
  printf("result=%d id=%lld ours=%d trace=%s model=%s version=%d items=%u\n",
         (int)reply->header.result, (long long)reply->header.related_request_id.sequence_number,
         is_ours, reply->header.trace_id, reply->model.hash, reply->model.version,
         reply->predictions._length);
  if (reply->predictions._length != poses) return fail("not as many predictions as poses");
  const trammel_wire_v2_PredictedError* predicted = &reply->predictions._buffer[0];
  printf("dx_mm=%.6f\n", predicted->dx_mm);
  const int failed =
      correct(participant, subscriber, status->server, argv[2], &predicted->nominal, &pose);
  dds_delete(participant);
  return failed;
}
