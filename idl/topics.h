#pragma once

#include <cstddef>

#include "correct_targetPubSubTypes.h"
#include "diagnosePubSubTypes.h"
#include "idl/limits.h"
#include "manage_modelsPubSubTypes.h"
#include "predict_errorPubSubTypes.h"
#include "statePubSubTypes.h"
#include "trainingPubSubTypes.h"

/// Every topic: its name, its type, its largest sample (bytes). An operation has the topics `<name>_Request` and
/// `<name>_Reply`; a client reads the latter in its own partition only.
namespace trammel::wire {

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
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};
struct Diagnose {
  using Request = DiagnoseRequestPubSubType;
  using Reply = DiagnoseReplyPubSubType;
  static constexpr const char* kName = "Diagnose";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};
struct ManageModels {
  using Request = ManageModelsRequestPubSubType;
  using Reply = ManageModelsReplyPubSubType;
  static constexpr const char* kName = "ManageModels";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
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
struct ServiceStatusTopic {
  using Type = ServiceStatusPubSubType;
  static constexpr const char* kName = "ServiceStatus";
  static constexpr std::size_t kMaxSample = kMaxStateSample;
};
struct ModelSnapshotTopic {
  using Type = ModelSnapshotPubSubType;
  static constexpr const char* kName = "ModelSnapshot";
  static constexpr std::size_t kMaxSample = kMaxTextSample;
};

}  // namespace trammel::wire
