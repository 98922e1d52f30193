#include "idl/repairs/valid.h"

#include <algorithm>

#include "idl/limits.h"

// The layout of each type of the IDL, member by member. tests/dds/safe_type_test.cpp holds it
// against the types.

namespace trammel::wire {
namespace {

constexpr std::size_t kNumber = 4;  // bytes; also of an empty text or list, its length

template <typename Struct>
struct Of {};  // which type a shape is of

void id(CdrWalk& walk, const char* field) { walk.text(field, MAX_ID, Text::kPlain); }
/// A name that a server tells; whoever shows it to people spells out what is not plain.
void told(CdrWalk& walk, const char* field) { walk.text(field, MAX_ID, Text::kAny); }
void sentence(CdrWalk& walk, const char* field) { walk.text(field, MAX_SENTENCE, Text::kAny); }
void spelling(CdrWalk& walk, const char* field) { walk.text(field, MAX_SPELLING, Text::kPlain); }
void token(CdrWalk& walk, const char* field) { walk.text(field, MAX_NAME, Text::kToken); }
void file_text(CdrWalk& walk, const char* field) { walk.text(field, kMaxText, Text::kAny); }

void batch_ids(CdrWalk& walk) {
  walk.list("batch_ids", MAX_BATCHES, kNumber, "batch", [&] { id(walk, "batch_ids"); });
}

void shape(CdrWalk& walk, Of<SampleIdentity>) {
  walk.octets(16);
  walk.wides(1);
}

/// A trace that is none is no reason to leave a request unanswered.
void shape(CdrWalk& walk, Of<RequestHeader>, Text trace = Text::kToken) {
  shape(walk, Of<SampleIdentity>());
  token(walk, "server");
  token(walk, "reply_partition");
  walk.longs(2);
  walk.text("trace_id", MAX_NAME, trace);
}

void shape(CdrWalk& walk, Of<Change>) {
  token(walk, "change id");
  walk.longs(1);
}

void shape(CdrWalk& walk, Of<Context>) {
  id(walk, "cell");
  id(walk, "tool");
  id(walk, "payload");
  walk.flag("controller_compensates");
  id(walk, "model");
}

void begin_request(CdrWalk& walk) {
  shape(walk, Of<RequestHeader>());
  shape(walk, Of<Context>());
}

void shape(CdrWalk& walk, Of<Problem>) {
  walk.enumerator("code", RESULT_MALFORMED);
  sentence(walk, "what");
  walk.text("file", MAX_ID, Text::kAny);
  walk.wides(1);
  walk.text("field", MAX_ID, Text::kAny);
  walk.flag("has_value");
  walk.wides(1);
  walk.flag("has_limit");
  walk.wides(1);
  walk.text("text", MAX_ID, Text::kAny);
  sentence(walk, "next");
}

void shape(CdrWalk& walk, Of<ReplyHeader>) {
  shape(walk, Of<SampleIdentity>());
  walk.enumerator("result", RESULT_MALFORMED);
  sentence(walk, "message");
  walk.list("problems", MAX_ERRORS, 8 * kNumber, "problem", [&] { shape(walk, Of<Problem>()); });
  walk.longs(1);
  token(walk, "server");
  walk.longs(1);
  token(walk, "trace_id");
}

void shape(CdrWalk& walk, Of<Note>) {
  token(walk, "note");
  walk.enumerator("severity", NOTE_STOP);
  sentence(walk, "note");
}

void shape(CdrWalk& walk, Of<ModelInfo>) {
  for (const char* field : {"cell", "id", "hash"}) told(walk, field);
  walk.text("level", MAX_SPELLING, Text::kAny);
  sentence(walk, "batch_id");
  told(walk, "batch_hash");
  walk.longs(1);
  walk.wides(5);
  walk.longs(1);
  walk.wides(1);
  walk.flag("in_force");
  walk.list("notes", MAX_NOTES, 3 * kNumber, "note", [&] { shape(walk, Of<Note>()); });
  walk.list("budget", MAX_BUDGET_LINES, kNumber, "line", [&] { sentence(walk, "budget"); });
}

void shape(CdrWalk& walk, Of<Joints>) { walk.wides(walk.list("joints_rad", MAX_JOINTS, 8)); }

void shape(CdrWalk& walk, Of<Approach>) {
  walk.shorts(walk.list("directions", MAX_JOINTS, 2));
  walk.wides(2);
}

void pose(CdrWalk& walk) { walk.wides(7); }

void shape(CdrWalk& walk, Of<PredictErrorRequest>) {
  begin_request(walk);
  walk.list("poses", MAX_TARGETS, 2 * kNumber + 16, "joint vector", [&] {
    shape(walk, Of<Joints>());
    shape(walk, Of<Approach>());
  });
}

void shape(CdrWalk& walk, Of<PredictErrorReply>) {
  shape(walk, Of<ReplyHeader>());
  shape(walk, Of<ModelInfo>());
  constexpr std::size_t kNumbers = 2 * 7 + 6 * 3 + 1;
  walk.list("predictions", MAX_TARGETS, 8 * kNumbers, "prediction", [&] {
    walk.wides(kNumbers);
    walk.flag("in_domain");
  });
}

void shape(CdrWalk& walk, Of<CorrectTargetRequest>) {
  begin_request(walk);
  walk.list("targets", MAX_TARGETS, 4 * kNumber + 9 * 8, "target", [&] {
    walk.enumerator("kind", TARGET_JOINTS);
    pose(walk);
    shape(walk, Of<Joints>());
    walk.longs(1);
    shape(walk, Of<Approach>());
  });
}

void shape(CdrWalk& walk, Of<CorrectTargetReply>) {
  shape(walk, Of<ReplyHeader>());
  shape(walk, Of<ModelInfo>());
  walk.list("corrections", MAX_TARGETS, 4 * kNumber + 13 * 8, "correction", [&] {
    walk.enumerator("status", TARGET_REFUSED);
    pose(walk);
    shape(walk, Of<Joints>());
    walk.wides(6);
    walk.longs(1);
    sentence(walk, "message");
  });
}

void shape(CdrWalk& walk, Of<SubmitMeasurementsRequest>) {
  begin_request(walk);
  token(walk, "change_id");
  id(walk, "batch_id");
  file_text(walk, "csv");
}

void queued(CdrWalk& walk) {
  shape(walk, Of<ReplyHeader>());
  walk.wides(1);
}
void shape(CdrWalk& walk, Of<SubmitMeasurementsReply>) { queued(walk); }
void shape(CdrWalk& walk, Of<TrainReply>) { queued(walk); }
void shape(CdrWalk& walk, Of<ReleaseBatchesReply>) { queued(walk); }

void shape(CdrWalk& walk, Of<TrainRequest>) {
  begin_request(walk);
  shape(walk, Of<Change>());
  walk.enumerator("kind", TRAIN_DIAGNOSED);
  batch_ids(walk);
  file_text(walk, "csv");
  walk.wides(1);
  for (const char* field : {"level", "bias", "batch_rule", "prior"}) spelling(walk, field);
}

void shape(CdrWalk& walk, Of<DiagnoseRequest>) {
  begin_request(walk);
  token(walk, "change_id");
  id(walk, "batch_id");
  file_text(walk, "csv");
}

void shape(CdrWalk& walk, Of<CheckHealthRequest>) {
  begin_request(walk);
  token(walk, "change_id");
  id(walk, "batch_id");
  file_text(walk, "csv");
  walk.wides(1);
}

void queued_of_model(CdrWalk& walk) {
  shape(walk, Of<ReplyHeader>());
  shape(walk, Of<ModelInfo>());
  walk.wides(1);
}
void shape(CdrWalk& walk, Of<DiagnoseReply>) { queued_of_model(walk); }
void shape(CdrWalk& walk, Of<CheckHealthReply>) { queued_of_model(walk); }

void shape(CdrWalk& walk, Of<ReadModelsRequest>) {
  begin_request(walk);
  walk.enumerator("what", READ_REPLAY);
  walk.longs(1);
  walk.wides(1);
  walk.flag("page");
  id(walk, "batch_id");
  walk.wides(1);
  walk.longs(1);
}

void shape(CdrWalk& walk, Of<Job>) {
  walk.wides(1);
  told(walk, "cell");
  walk.enumerator("kind", JOB_CHECK);
  walk.enumerator("stage", JOB_CANCELLED);
  sentence(walk, "what");
  walk.wides(1);
  walk.longs(1);
  walk.flag("in_force");
  walk.enumerator("verdict", VERDICT_CANCELLED);
  walk.enumerator("held_back", HELD_BACK_STEP_LIMIT);
  walk.wides(4);
  walk.enumerator("code", RESULT_MALFORMED);
  sentence(walk, "why");
  sentence(walk, "next");
  walk.wides(2);
  walk.list("batch_ids", MAX_BATCHES, kNumber, "batch", [&] { told(walk, "batch_ids"); });
  walk.wides(3);
  told(walk, "server");
}

void shape(CdrWalk& walk, Of<ReadModelsReply>) {
  shape(walk, Of<ReplyHeader>());
  walk.list("models", MAX_VERSIONS, 64, "model", [&] { shape(walk, Of<ModelInfo>()); });
  walk.list("jobs", MAX_JOBS, 64, "job", [&] { shape(walk, Of<Job>()); });
  walk.list("batches", MAX_VERSIONS, 24, "batch", [&] {
    for (const char* field : {"cell", "id", "hash"}) told(walk, field);
    walk.longs(1);
    walk.wides(1);
    sentence(walk, "quarantine");
    walk.flag("learned");
  });
  shape(walk, Of<ModelInfo>());
  walk.longs(1);
  file_text(walk, "text");
  file_text(walk, "page_html");
}

void shape(CdrWalk& walk, Of<ManageModelsRequest>) {
  begin_request(walk);
  shape(walk, Of<Change>());
  walk.enumerator("action", MANAGE_BACKUP);
  walk.longs(1);
  walk.flag("force");
  walk.wides(1);
  file_text(walk, "model_text");
  spelling(walk, "reason");
}

void shape(CdrWalk& walk, Of<ManageModelsReply>) {
  shape(walk, Of<ReplyHeader>());
  walk.longs(1);
  shape(walk, Of<ModelInfo>());
}

void shape(CdrWalk& walk, Of<ReleaseBatchesRequest>) {
  begin_request(walk);
  shape(walk, Of<Change>());
  walk.enumerator("action", RELEASE_DISCARD);
  batch_ids(walk);
  for (const char* field : {"level", "bias", "reason"}) spelling(walk, field);
}

void shape(CdrWalk& walk, Of<ModelStatus>) {
  walk.text("cell", MAX_NAME, Text::kPlain);
  id(walk, "server");
  shape(walk, Of<ModelInfo>());
}

void shape(CdrWalk& walk, Of<TrainingProgress>) {
  token(walk, "server");
  walk.wides(1);
  shape(walk, Of<Job>());
}

void shape(CdrWalk& walk, Of<ServiceStatus>) {
  token(walk, "server");
  walk.longs(1);
  id(walk, "program_version");
  walk.enumerator("state", SERVICE_STOPPING);
  walk.list("cells", MAX_CELLS, kNumber, "cell", [&] { id(walk, "cells"); });
  walk.longs(1);
  walk.wides(8);
  walk.longs(1);
  sentence(walk, "trouble");
  token(walk, "record");
}

void shape(CdrWalk& walk, Of<SpokenContract>) {
  token(walk, "server");
  walk.longs(1);
  id(walk, "program_version");
}

}  // namespace

bool valid_partition(std::string_view name) {
  return !name.empty() && name.size() <= MAX_NAME &&
         std::all_of(name.begin(), name.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '.' || c == '_' || c == '-';
         });
}

template <typename Sample>
std::optional<Fault> find_fault(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  shape(walk, Of<Sample>());
  walk.end();
  return walk.fault();
}

template <>
std::optional<Fault> find_fault<RequestHeader>(std::span<const unsigned char> sample) {
  CdrWalk walk(sample);
  shape(walk, Of<RequestHeader>(), Text::kAny);
  return walk.fault();
}

using Sample = std::span<const unsigned char>;
template std::optional<Fault> find_fault<PredictErrorRequest>(Sample);
template std::optional<Fault> find_fault<PredictErrorReply>(Sample);
template std::optional<Fault> find_fault<CorrectTargetRequest>(Sample);
template std::optional<Fault> find_fault<CorrectTargetReply>(Sample);
template std::optional<Fault> find_fault<SubmitMeasurementsRequest>(Sample);
template std::optional<Fault> find_fault<SubmitMeasurementsReply>(Sample);
template std::optional<Fault> find_fault<TrainRequest>(Sample);
template std::optional<Fault> find_fault<TrainReply>(Sample);
template std::optional<Fault> find_fault<DiagnoseRequest>(Sample);
template std::optional<Fault> find_fault<DiagnoseReply>(Sample);
template std::optional<Fault> find_fault<CheckHealthRequest>(Sample);
template std::optional<Fault> find_fault<CheckHealthReply>(Sample);
template std::optional<Fault> find_fault<ReadModelsRequest>(Sample);
template std::optional<Fault> find_fault<ReadModelsReply>(Sample);
template std::optional<Fault> find_fault<ManageModelsRequest>(Sample);
template std::optional<Fault> find_fault<ManageModelsReply>(Sample);
template std::optional<Fault> find_fault<ReleaseBatchesRequest>(Sample);
template std::optional<Fault> find_fault<ReleaseBatchesReply>(Sample);
template std::optional<Fault> find_fault<ModelStatus>(Sample);
template std::optional<Fault> find_fault<TrainingProgress>(Sample);
template std::optional<Fault> find_fault<ServiceStatus>(Sample);
template std::optional<Fault> find_fault<SpokenContract>(Sample);

}  // namespace trammel::wire
