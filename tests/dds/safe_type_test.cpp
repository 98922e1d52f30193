#include "idl/repairs/safe_type.h"

#include <gtest/gtest.h>

#include <random>
#include <span>

#include "idl/topics.h"
#include "tests/dds/raw_client.h"

namespace trammel::wire {
namespace {

using test::Bytes;

CorrectTargetRequest good_request() {
  CorrectTargetRequest request;
  request.header().reply_partition("client-1");
  request.about().cell("cell-7");
  Target target;
  target.joints_rad({0.1, 0.2, 0.3, 0.4, 0.5, 0.6});
  request.targets({target, target});
  return request;
}

template <typename PubSubType = CorrectTarget::Request>
bool reads(Bytes bytes, std::size_t limit = kMaxComputeSample) {
  SafeType<PubSubType> type(limit);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  typename PubSubType::type sample;
  return type.deserialize(&payload, &sample);
}

Bytes bytes_of(const CorrectTargetRequest& request) {
  return test::to_bytes<CorrectTarget::Request>(request);
}

TEST(SafeType, ReadsAGoodSample) { EXPECT_TRUE(reads(bytes_of(good_request()))); }

TEST(SafeType, DropsEveryTruncation) {
  const Bytes whole = bytes_of(good_request());
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FALSE(reads(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length))))
        << length;
  }
}

TEST(SafeType, DropsAnUnknownEncapsulation) {
  Bytes bytes = bytes_of(good_request());
  bytes[0] = 0xff;
  bytes[1] = 0xff;
  EXPECT_FALSE(reads(bytes));
}

TEST(SafeType, DropsASampleOverItsLimit) {
  const Bytes bytes = bytes_of(good_request());
  EXPECT_TRUE(reads(bytes, bytes.size()));
  EXPECT_FALSE(reads(bytes, bytes.size() - 1));
}

TEST(SafeType, DropsUnknownEnumerators) {
  CorrectTargetRequest request = good_request();
  request.targets()[1].kind(static_cast<TargetKind>(99));
  EXPECT_FALSE(reads(bytes_of(request)));

  ManageModelsRequest manage;
  manage.header().reply_partition("client-1");
  EXPECT_TRUE(reads<ManageModels::Request>(test::to_bytes<ManageModels::Request>(manage)));
  manage.action(static_cast<ManageAction>(MANAGE_BACKUP + 1));
  EXPECT_FALSE(reads<ManageModels::Request>(test::to_bytes<ManageModels::Request>(manage)));
}

TEST(SafeType, DropsRepliesOverTheirBounds) {
  PredictErrorReply reply;
  reply.predictions().resize(MAX_TARGETS + 1);
  EXPECT_FALSE(reads<PredictError::Reply>(test::to_bytes<PredictError::Reply>(reply)));
  reply.predictions().resize(MAX_TARGETS);
  EXPECT_TRUE(reads<PredictError::Reply>(test::to_bytes<PredictError::Reply>(reply)));
}

/// The shape of a type is the type's: a sample has no fault, and every one that ends too early has.
template <typename PubSubType>
void expect_shape(const typename PubSubType::type& sample) {
  using Sample = typename PubSubType::type;
  const Bytes whole = test::to_bytes<PubSubType>(sample);
  const auto fault = find_fault<Sample>(whole);
  EXPECT_FALSE(fault) << PubSubType().getName() << ": " << fault->what << " (" << fault->field
                      << ")";
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_TRUE(find_fault<Sample>(std::span(whole).first(length)))
        << PubSubType().getName() << " " << length;
  }
  Bytes longer = whole;
  longer.resize(whole.size() + 4);
  EXPECT_TRUE(find_fault<Sample>(longer)) << PubSubType().getName();
}

template <typename PubSubType>
typename PubSubType::type filled() {
  typename PubSubType::type sample;
  if constexpr (requires { sample.header().reply_partition(); }) {
    sample.header().reply_partition("client-1");
    sample.header().trace_id("t");
    sample.about().cell("cell-7");
    sample.about().model("@3");
  } else if constexpr (requires { sample.header().problems(); }) {
    Problem problem;
    problem.what("too much");
    problem.next("take less");
    sample.header().problems({problem, problem});
    sample.header().message("too much; take less");
  }
  return sample;
}

ModelInfo some_model() {
  ModelInfo model;
  model.cell("cell-7");
  model.level("M2,gear_transmission:3");
  model.batch_hash("0123");
  model.in_force(true);
  Note note;
  note.code("robot_not_confirmed");
  note.severity(NOTE_STOP);
  note.text("Nobody compared it.");
  model.notes({note, note});
  model.budget({"the drawing is off by 1 mm", "the zero of joint 4"});
  return model;
}

Job some_job() {
  Job job;
  job.cell("cell-7");
  job.what("better");
  job.batch_ids({"lt-07", "lt-8"});
  job.outcome().why("because");
  job.outcome().verdict(VERDICT_CANCELLED);
  job.outcome().held_back(HELD_BACK_STEP_LIMIT);
  return job;
}

TEST(SafeType, TheShapeOfEveryRequestIsThatOfItsType) {
  auto predict = filled<PredictError::Request>();
  predict.poses().resize(2);
  predict.poses()[0].joints_rad({1, 2, 3});
  predict.poses()[1].approach().directions({1, 0, -1});
  expect_shape<PredictError::Request>(predict);
  auto correct = filled<CorrectTarget::Request>();
  correct.targets().resize(3);
  correct.targets()[1].joints_rad({1});
  correct.targets()[2].approach().directions({1});
  expect_shape<CorrectTarget::Request>(correct);
  auto train = filled<Train::Request>();
  train.batch_ids({"a", "bcd"});
  train.level("M1");
  train.change().id("change-1");
  expect_shape<Train::Request>(train);
  auto release = filled<ReleaseBatches::Request>();
  release.batch_ids({"a", "bcd"});
  expect_shape<ReleaseBatches::Request>(release);
  expect_shape<SubmitMeasurements::Request>(filled<SubmitMeasurements::Request>());
  expect_shape<Diagnose::Request>(filled<Diagnose::Request>());
  expect_shape<CheckHealth::Request>(filled<CheckHealth::Request>());
  expect_shape<ReadModels::Request>(filled<ReadModels::Request>());
  expect_shape<ManageModels::Request>(filled<ManageModels::Request>());
}

TEST(SafeType, TheShapeOfEveryReplyAndStateIsThatOfItsType) {
  auto predict = filled<PredictError::Reply>();
  predict.predictions().resize(2);
  expect_shape<PredictError::Reply>(predict);
  auto correct = filled<CorrectTarget::Reply>();
  correct.corrections().resize(2);
  correct.corrections()[0].joints_rad({1, 2});
  correct.corrections()[0].message("because");
  expect_shape<CorrectTarget::Reply>(correct);
  auto read = filled<ReadModels::Reply>();
  read.models({some_model(), some_model()});
  read.jobs({some_job(), some_job()});
  BatchInfo batch;
  batch.id("lt-07");
  batch.quarantine("it does not fit");
  batch.learned(true);
  read.batches({batch});
  read.text("{}");
  expect_shape<ReadModels::Reply>(read);
  expect_shape<SubmitMeasurements::Reply>(filled<SubmitMeasurements::Reply>());
  expect_shape<Train::Reply>(filled<Train::Reply>());
  expect_shape<Diagnose::Reply>(filled<Diagnose::Reply>());
  expect_shape<CheckHealth::Reply>(filled<CheckHealth::Reply>());
  expect_shape<ManageModels::Reply>(filled<ManageModels::Reply>());
  expect_shape<ReleaseBatches::Reply>(filled<ReleaseBatches::Reply>());
  ModelStatus model;
  model.cell("cell-7");
  model.model(some_model());
  expect_shape<ModelStatusTopic::Type>(model);
  TrainingProgress progress;
  progress.job(some_job());
  expect_shape<TrainingProgressTopic::Type>(progress);
  ServiceStatus status;
  status.cells({"cell-7", "c"});
  status.trouble("the disk is full");
  expect_shape<ServiceStatusTopic::Type>(status);
}

TEST(SafeType, AHostileLengthIsRefusedBeforeMemoryIsAskedFor) {
  PredictErrorRequest request = filled<PredictError::Request>();
  Bytes bytes = test::to_bytes<PredictError::Request>(request);
  bytes.resize(kMaxComputeSample);  // room for a million elements of a few octets
  const std::size_t length_at = test::to_bytes<PredictError::Request>(request).size() - 4;
  for (const std::uint32_t count : {MAX_TARGETS + 1, 1'000'000U, 0xffffffffU}) {
    for (std::size_t i = 0; i < 4; ++i)
      bytes[length_at + i] = static_cast<unsigned char>(count >> (8 * i));
    const auto fault = find_fault<PredictErrorRequest>(bytes);
    ASSERT_TRUE(fault);
    EXPECT_EQ(fault->code, RESULT_TOO_LARGE);
    EXPECT_EQ(fault->field, "poses");
    EXPECT_EQ(fault->value, count);
    EXPECT_EQ(fault->limit, MAX_TARGETS);
  }
}

TEST(SafeType, DoesNotBelieveAHostileLength) {
  Bytes bytes = bytes_of(good_request());
  const std::size_t tail = bytes.size() - 2 * 120;
  for (std::size_t i = 4; i + 4 <= tail; i += 4) {
    Bytes hostile = bytes;
    std::fill_n(hostile.begin() + static_cast<std::ptrdiff_t>(i), 4,
                static_cast<unsigned char>(0xff));
    static_cast<void>(reads(hostile));  // neither throws nor runs out of memory
  }
}

TEST(SafeType, SurvivesTwentyThousandMutations) {
  const Bytes whole = bytes_of(good_request());
  std::mt19937 random(7);
  std::uniform_int_distribution<std::size_t> position(0, whole.size() - 1);
  std::uniform_int_distribution<int> value(0, 255);
  int dropped = 0;
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = whole;
    for (int k = 0; k < 4; ++k) bytes[position(random)] = static_cast<unsigned char>(value(random));
    dropped += reads(bytes) ? 0 : 1;
  }
  EXPECT_GT(dropped, 0);
  EXPECT_LT(dropped, 20000);
}

TEST(SafeType, DoesNotSendASampleThatTheOtherSideWouldDrop) {
  SafeType<SubmitMeasurements::Request> type(1000);
  SubmitMeasurementsRequest request;
  request.csv(std::string(2000, 'x'));
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&request)());
  EXPECT_FALSE(type.serialize(&request, &payload));
}

TEST(SafeType, ReservesLittleForLongSequences) {
  EXPECT_LE(SafeType<PredictError::Reply>(kMaxComputeSample).m_typeSize, 4096u);
}

}  // namespace
}  // namespace trammel::wire
