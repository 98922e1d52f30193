/* A client of contract 1, built with another maker's DDS from the IDL of that time. Waits for a server's status, asks
 * it for a prediction and for the list of models, and prints what it is told. Usage: cyclone_client_1 DOMAIN CELL
 * [LIMIT_S]. The network is set by CYCLONEDDS_URI. */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "manage_models.h"
#include "predict_error.h"
#include "state.h"

#define PARTITION "cyclone-1"
#define SEQUENCE_NUMBER 4711

static dds_duration_t limit = DDS_SECS(20);

static int fail(const char* what) {
  fprintf(stderr, "cyclone_client_1: %s\n", what);
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

/* Until the server reads what `writer` writes and writes what `reader` reads. */
static int matched(dds_entity_t participant, dds_entity_t writer, dds_entity_t reader) {
  dds_publication_matched_status_t there;
  if (dds_get_publication_matched_status(writer, &there) != DDS_RETCODE_OK) return 0;
  if (there.current_count == 0 && !wait_for(participant, writer, DDS_PUBLICATION_MATCHED_STATUS)) return 0;
  dds_subscription_matched_status_t back;
  if (dds_get_subscription_matched_status(reader, &back) != DDS_RETCODE_OK) return 0;
  return back.current_count > 0 || wait_for(participant, reader, DDS_SUBSCRIPTION_MATCHED_STATUS);
}

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) return fail("usage: cyclone_client_1 DOMAIN CELL [LIMIT_S]");
  if (argc == 4) limit = DDS_SECS(atoi(argv[3]));
  /* Without it Cyclone DDS would speak on every interface; with it, on the loopback profile that it holds. */
  if (getenv("CYCLONEDDS_URI") == NULL) return fail("CYCLONEDDS_URI must hold the loopback profile");
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(argv[1]), NULL, NULL);
  if (participant < 0) return fail("no participant");

  const dds_entity_t status_topic =
      dds_create_topic(participant, &trammel_wire_ServiceStatus_desc, "ServiceStatus", NULL, NULL);
  const dds_entity_t request_topic =
      dds_create_topic(participant, &trammel_wire_PredictErrorRequest_desc, "PredictError_Request", NULL, NULL);
  const dds_entity_t reply_topic =
      dds_create_topic(participant, &trammel_wire_PredictErrorReply_desc, "PredictError_Reply", NULL, NULL);
  const dds_entity_t status_reader = dds_create_reader(participant, status_topic, state_qos(), NULL);
  const char* partitions[1] = {PARTITION};
  dds_qos_t* subscriber_qos = dds_create_qos();
  dds_qset_partition(subscriber_qos, 1, partitions);
  const dds_entity_t subscriber = dds_create_subscriber(participant, subscriber_qos, NULL);
  const dds_entity_t reply_reader = dds_create_reader(subscriber, reply_topic, call_qos(), NULL);
  const dds_entity_t request_writer = dds_create_writer(participant, request_topic, call_qos(), NULL);
  const dds_entity_t list_topic =
      dds_create_topic(participant, &trammel_wire_ManageModelsRequest_desc, "ManageModels_Request", NULL, NULL);
  const dds_entity_t listed_topic =
      dds_create_topic(participant, &trammel_wire_ManageModelsReply_desc, "ManageModels_Reply", NULL, NULL);
  const dds_entity_t listed_reader = dds_create_reader(subscriber, listed_topic, call_qos(), NULL);
  const dds_entity_t list_writer = dds_create_writer(participant, list_topic, call_qos(), NULL);
  if (status_reader < 0 || reply_reader < 0 || request_writer < 0 || listed_reader < 0 || list_writer < 0)
    return fail("no endpoints");

  const trammel_wire_ServiceStatus* status = take_one(participant, status_reader);
  if (status == NULL) return fail("no ServiceStatus");
  printf("server=%s contract=%u cells=%u\n", status->server, status->contract_version, status->cells._length);
  if (!matched(participant, request_writer, reply_reader) || !matched(participant, list_writer, listed_reader))
    return fail("no server reads requests and writes replies");

  double values[6] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  trammel_wire_Joints joints = {._maximum = 6, ._length = 6, ._buffer = values, ._release = false};
  char empty[1] = "";
  trammel_wire_PredictErrorRequest request;
  memset(&request, 0, sizeof request);
  memset(request.header.request_id.writer_guid, 0xc7, sizeof request.header.request_id.writer_guid);
  request.header.request_id.sequence_number = SEQUENCE_NUMBER;
  strcpy(request.header.server, status->server);
  strcpy(request.header.reply_partition, PARTITION);
  request.header.contract_version = trammel_wire_CONTRACT_VERSION;
  request.about.cell = argv[2];
  request.about.tool = empty;
  request.about.payload = empty;
  request.about.model = empty;
  request.joints_rad._maximum = 1;
  request.joints_rad._length = 1;
  request.joints_rad._buffer = &joints;
  if (dds_write(request_writer, &request) != DDS_RETCODE_OK) return fail("cannot write the request");

  const trammel_wire_PredictErrorReply* reply = take_one(participant, reply_reader);
  if (reply == NULL) return fail("no reply");
  printf("predict: result=%d id=%lld contract=%u items=%u: %s\n", (int)reply->header.result,
         (long long)reply->header.related_request_id.sequence_number, reply->header.contract_version,
         reply->predictions._length, reply->header.message);

  trammel_wire_ManageModelsRequest list;
  memset(&list, 0, sizeof list);
  list.header = request.header;
  list.about = request.about;
  list.text = empty;
  if (dds_write(list_writer, &list) != DDS_RETCODE_OK) return fail("cannot write the request for a list");
  const trammel_wire_ManageModelsReply* listed = take_one(participant, listed_reader);
  if (listed == NULL) return fail("no list");
  printf("list: result=%d models=%u\n", (int)listed->header.result, listed->models._length);
  dds_delete(participant);
  return 0;
}
