#include "idl/safe_type.h"

#include <gtest/gtest.h>

#include <random>

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

Bytes bytes_of(const CorrectTargetRequest& request) { return test::to_bytes<CorrectTarget::Request>(request); }

TEST(SafeType, ReadsAGoodSample) { EXPECT_TRUE(reads(bytes_of(good_request()))); }

TEST(SafeType, DropsEveryTruncation) {
  const Bytes whole = bytes_of(good_request());
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FALSE(reads(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)))) << length;
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

TEST(SafeType, DoesNotBelieveAHostileLength) {
  Bytes bytes = bytes_of(good_request());
  const std::size_t tail = bytes.size() - 2 * 120;
  for (std::size_t i = 4; i + 4 <= tail; i += 4) {
    Bytes hostile = bytes;
    std::fill_n(hostile.begin() + static_cast<std::ptrdiff_t>(i), 4, static_cast<unsigned char>(0xff));
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
