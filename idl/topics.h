#pragma once

#include <cstddef>

#include "contractPubSubTypes.h"
#include "correct_targetPubSubTypes.h"
#include "diagnosePubSubTypes.h"
#include "idl/limits.h"
#include "manage_modelsPubSubTypes.h"
#include "predict_errorPubSubTypes.h"
#include "read_modelsPubSubTypes.h"
#include "release_batchesPubSubTypes.h"
#include "statePubSubTypes.h"
#include "trainingPubSubTypes.h"

/// Every topic: its name, its type, its largest sample (bytes). An operation has the topics
/// `<name>_2_Request` and
/// `<name>_2_Reply`, a state the topic `<name>_2`: the number is that of the contract
/// (transport.h). A client reads replies in its own partition only. Permissions are given by topic:
/// who may read (PredictError, CorrectTarget, ReadModels), submit (SubmitMeasurements, Diagnose,
/// CheckHealth), change (Train, ManageModels), release (ReleaseBatches).
namespace trammel::wire {

using namespace v2;

struct PredictError {
  using Request = PredictErrorRequestPubSubType;
  using Reply = PredictErrorReplyPubSubType;
  static constexpr const char* kName = "PredictError";
  static constexpr std::size_t kMaxSample = kMaxComputeSample;
};
struct CorrectTarget {
  using Request = CorrectTargetRequestPubSubType;
  using Reply = CorrectTargetReplyPubSubType;
  static constexpr const char* kName = "CorrectTarget";
  static constexpr std::size_t kMaxSample = kMaxComputeSample;
};
struct SubmitMeasurements {
  using Request = SubmitMeasurementsRequestPubSubType;
  using Reply = SubmitMeasurementsReplyPubSubType;
  static constexpr const char* kName = "SubmitMeasurements";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct Train {
  using Request = TrainRequestPubSubType;
  using Reply = TrainReplyPubSubType;
  static constexpr const char* kName = "Train";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct Diagnose {
  using Request = DiagnoseRequestPubSubType;
  using Reply = DiagnoseReplyPubSubType;
  static constexpr const char* kName = "Diagnose";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct CheckHealth {
  using Request = CheckHealthRequestPubSubType;
  using Reply = CheckHealthReplyPubSubType;
  static constexpr const char* kName = "CheckHealth";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct ReadModels {
  using Request = ReadModelsRequestPubSubType;
  using Reply = ReadModelsReplyPubSubType;
  static constexpr const char* kName = "ReadModels";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct ManageModels {
  using Request = ManageModelsRequestPubSubType;
  using Reply = ManageModelsReplyPubSubType;
  static constexpr const char* kName = "ManageModels";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct ReleaseBatches {
  using Request = ReleaseBatchesRequestPubSubType;
  using Reply = ReleaseBatchesReplyPubSubType;
  static constexpr const char* kName = "ReleaseBatches";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};

struct ModelStatusTopic {
  using Type = ModelStatusPubSubType;
  static constexpr const char* kName = "ModelStatus";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};
struct TrainingProgressTopic {
  using Type = TrainingProgressPubSubType;
  static constexpr const char* kName = "TrainingProgress";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};
/// Not of one contract: its name has no number.
struct SpokenContractTopic {
  using Type = SpokenContractPubSubType;
  static constexpr const char* kName = "SpokenContract";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};
struct ServiceStatusTopic {
  using Type = ServiceStatusPubSubType;
  static constexpr const char* kName = "ServiceStatus";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};

}  // namespace trammel::wire
