#include "server/dds/reply_channel.h"

#include <gtest/gtest.h>

#include "server/dds/codec.h"
#include "server/dds/sent_type.h"
#include "tests/support/own_ports.h"

namespace trammel {
namespace {

const std::string kFastDds = "\x01\x0f..........", kCyclone = "\x01\x10..........";

class ParkedChannelsTest : public testing::Test {
 protected:
  ParkedChannels::Channel channel(const std::string& partition) {
    return std::make_shared<ReplyChannel>(*participant_, partition);
  }

  wire::ParticipantPtr participant_ =
      wire::make_participant({"parked", 42, "127.0.0.1", test::own_ports(), {}}).value();
  ParkedChannels parked_;
  ParkedChannels::Time now_ = std::chrono::steady_clock::now();
};

TEST_F(ParkedChannelsTest, AChannelMovesOnToTheNextClientWithItsWriters) {
  const auto topic = wire::make_reply_topic<wire::Train>(*participant_);
  ASSERT_TRUE(topic);
  const auto first = channel("first");
  first->add("Train_Reply", ReplyWriter::make(*first->publisher(), *topic, [] {}));
  parked_.park(first, now_);
  EXPECT_EQ(parked_.take(kFastDds, "second"), first);
  EXPECT_NE(first->writer("Train_Reply"), nullptr);
  wire::dds::PublisherQos qos;
  ASSERT_EQ(first->publisher()->get_qos(qos), eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK);
  EXPECT_EQ(qos.partition().names(), std::vector<std::string>{"second"});
  EXPECT_EQ(parked_.take(kFastDds, "third"), nullptr) << "there was one";
}

TEST_F(ParkedChannelsTest, AClientWhoseLibraryDoesNotFollowGetsANewOne) {
  parked_.park(channel("first"), now_);
  EXPECT_EQ(parked_.take(kCyclone, "second"), nullptr);
  EXPECT_EQ(parked_.size(), 1u);
}

TEST_F(ParkedChannelsTest, WhoeverComesAgainUnderItsNameGetsItsChannelAgain) {
  const auto own = channel("own"), other = channel("other");
  for (const std::string& library : {kCyclone, kFastDds}) {
    parked_.park(own, now_);
    parked_.park(other, now_);
    EXPECT_EQ(parked_.take(library, "own"), own);
    EXPECT_EQ(parked_.take(library, "other"), other);
  }
  parked_.park(own, now_);
  EXPECT_EQ(parked_.take(kFastDds, "third"), own) << "nobody has come again for it";
  parked_.park(own, now_);
  EXPECT_EQ(parked_.take(kCyclone, "own"), nullptr) << "it has moved on";
  EXPECT_EQ(parked_.take(kCyclone, "third"), own);
}

TEST_F(ParkedChannelsTest, WhatIsLeftOverIsDeletedOnceNobodyLeavesAnyMore) {
  for (int i = 0; i < 30; ++i) parked_.park(channel("client-" + std::to_string(i)), now_);
  EXPECT_FALSE(parked_.tend(now_ + wire::kLease)) << "clients come and go";
  EXPECT_EQ(parked_.size(), 30u);
  while (parked_.tend(now_ + 3 * wire::kLease)) continue;
  EXPECT_EQ(parked_.size(), 8u);
}

TEST_F(ParkedChannelsTest, AReplyThatTheWireCannotCarryIsAnsweredByAnError) {
  const auto topic = make_sent_topic<wire::PredictError>(*participant_);
  ASSERT_TRUE(topic);
  const auto to = channel("client");
  wire::PredictErrorReply reply;
  reply.header().contract_version(wire::CONTRACT_VERSION);
  reply.header().related_request_id().sequence_number(7);
  EXPECT_TRUE(ReplyWriter::make(*to->publisher(), *topic, [] {})->write(&reply));
  reply.model().level(std::string(wire::MAX_SPELLING + 1, 'x'));
  EXPECT_FALSE(ReplyWriter::make(*to->publisher(), *topic, [] {})->write(&reply));
  const auto error = std::static_pointer_cast<wire::PredictErrorReply>(
      instead_of<wire::PredictErrorReply>(&reply));
  EXPECT_EQ(error->header().result(), wire::RESULT_INTERNAL);
  EXPECT_EQ(error->header().related_request_id().sequence_number(), 7);
  EXPECT_TRUE(ReplyWriter::make(
                  *to->publisher(), *topic, [] {}, instead_of<wire::PredictErrorReply>)
                  ->write(&reply));
}

}  // namespace
}  // namespace trammel
