#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "server/base/units.h"
#include "server/dds/ros2/translated.h"
#include "tests/dds/raw_client.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

// Messages that ROS 2 nodes send and get. That they meet the server under these names:
// tests/end_to_end/interoperability_test.cpp.

namespace trammel {
namespace {

using test::Bytes;
using wire::ros2::CorrectTargets_;
using wire::ros2::PredictErrors_;
using PredictType = wire::Ros2PredictErrors::Request;
using CorrectType = wire::Ros2CorrectTargets::Request;

PredictErrors_ good_question() {
  PredictErrors_ question;
  question.id("node-1/1");
  question.cell("cell-7");
  question.joints(6);
  question.joints_rad({0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0, 0, 0, 0, 0, 0});
  return question;
}

/// The message that a server makes of the bytes; empty: dropped.
template <typename PubSubType>
std::optional<wire::ReceivedMessage<typename PubSubType::type>> received(
    Bytes bytes, std::size_t limit = 1 << 20) {
  const auto unreadable = std::make_shared<std::atomic<std::uint64_t>>(0);
  wire::ReceivedMessageType<PubSubType> type(limit, unreadable);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  std::copy(bytes.begin(), bytes.end(), payload.data);
  payload.length = static_cast<std::uint32_t>(bytes.size());
  wire::ReceivedMessage<typename PubSubType::type> message;
  const bool taken = type.deserialize(&payload, &message);
  EXPECT_EQ(*unreadable, taken ? 0u : 1u);
  if (!taken) return std::nullopt;
  return message;
}

Bytes bytes_of(const PredictErrors_& question) { return test::to_bytes<PredictType>(question); }

ServedCells cells() { return {{"cell-7", test::small_cell("cell-7")}}; }

template <typename Message>
wire::ReceivedMessage<Message> as_received(const Message& message) {
  wire::ReceivedMessage<Message> received;
  static_cast<Message&>(received) = message;
  return received;
}

/// Names and types of the members, in their order, as ROS 2 spells them.
std::string members_of(const std::string& text, const std::regex& member,
                       const std::map<std::string, std::string>& as) {
  std::string all;
  for (auto at = std::sregex_iterator(text.begin(), text.end(), member);
       at != std::sregex_iterator(); ++at) {
    const std::string type = (*at)[1];
    all += (as.contains(type) ? as.at(type) : type) + " " + (*at)[2].str() + "\n";
  }
  return all;
}

TEST(Ros2Messages, AreThoseOfTheIdl) {
  const std::string folder = TRAMMEL_SOURCE_DIR "/idl/ros2/";
  const std::string idl = test::read_file(folder + "trammel_msgs.idl");
  const std::map<std::string, std::string> as = {
      {"unsigned long", "uint32"},
      {"long", "int32"},
      {"sequence<double>", "float64[]"},
      {"sequence<octet>", "uint8[]"},
      {"sequence<boolean>", "bool[]"},
      {"sequence<string>", "string[]"},
      {"sequence<geometry_msgs::msg::dds_::Pose_>", "geometry_msgs/Pose[]"}};
  for (const std::string name :
       {"PredictErrors", "PredictedErrors", "CorrectTargets", "CorrectedTargets"}) {
    const std::size_t begin = idl.find("struct " + name + "_ {"), end = idl.find("};", begin);
    ASSERT_NE(begin, std::string::npos) << name;
    const std::string here = members_of(idl.substr(begin, end - begin),
                                        std::regex("\n  ([a-z][A-Za-z_:<> 0-9]*) ([a-z_]+);"), as);
    const std::string there =
        members_of("\n" + test::read_file(folder + "trammel_msgs/msg/" + name + ".msg"),
                   std::regex("\n([a-z][A-Za-z0-9_/\\[\\]]*) +([a-z_]+)(?= |\n)"), {});
    EXPECT_EQ(here, there) << name;
    EXPECT_NE(here, "") << name;
  }
}

TEST(Ros2Messages, CarryTheirNamesOnTheWire) {
  EXPECT_STREQ(PredictType().getName(), "trammel_msgs::msg::dds_::PredictErrors_");
  EXPECT_STREQ(CorrectType().getName(), "trammel_msgs::msg::dds_::CorrectTargets_");
}

TEST(Ros2Messages, AreReadWhole) {
  const auto message = received<PredictType>(bytes_of(good_question()));
  ASSERT_TRUE(message);
  EXPECT_FALSE(message->fault);
  EXPECT_EQ(message->joints_rad(), good_question().joints_rad());
}

TEST(Ros2Messages, AreNeverBelievedWhereTheyEndTooEarly) {
  const Bytes whole = bytes_of(good_question());
  int told = 0;
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto message = received<PredictType>(
        Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)));
    if (!message) continue;
    ++told;
    EXPECT_EQ(message->id(), "node-1/1") << length;
    EXPECT_TRUE(message->fault) << length;
  }
  EXPECT_GT(told, 100) << "whoever sent an id is told";
}

TEST(Ros2Messages, WithoutAnIdCannotBeAnswered) {
  for (const std::string& id : {std::string(), std::string("two words"), std::string(65, 'x')}) {
    PredictErrors_ question = good_question();
    question.id(id);
    EXPECT_FALSE(received<PredictType>(bytes_of(question))) << id;
  }
}

TEST(Ros2Messages, OverALimitAreToldSo) {
  const auto message = received<PredictType>(bytes_of(good_question()), 64);
  ASSERT_TRUE(message && message->fault);
  EXPECT_EQ(message->fault->code, wire::RESULT_TOO_LARGE);
}

TEST(Ros2Messages, AskTheSameOnTheWireInItsUnits) {
  CorrectTargets_ question;
  question.id("node-1/2");
  question.cell("cell-7");
  question.deadline_ms(700);
  question.poses().resize(1);
  question.poses()[0].position().z(1.5);
  question.poses()[0].orientation().w(1);
  question.conf({3});
  const auto request = ros2::asked(as_received(question), cells());
  EXPECT_FALSE(request->fault);
  EXPECT_EQ(request->header().trace_id().to_string(), "node-1/2");
  EXPECT_EQ(request->header().deadline_ms(), 700u);
  ASSERT_EQ(request->targets().size(), 1u);
  const wire::Target& target = request->targets()[0];
  EXPECT_EQ(target.kind(), wire::TARGET_POSE_ON_BRANCH);
  EXPECT_EQ(target.pose().z_mm(), 1500);
  EXPECT_EQ(target.pose().qw(), 1);
  EXPECT_EQ(target.conf(), 3);
  EXPECT_TRUE(std::isnan(target.approach().temperature_c()));
}

TEST(Ros2Messages, WhoseListsDoNotFitEachOtherAreRefused) {
  const auto fault_of = [](const CorrectTargets_& question) {
    return ros2::asked(as_received(question), cells())->fault;
  };
  CorrectTargets_ question;
  question.poses().resize(2);
  EXPECT_EQ(fault_of(question)->field, "conf") << "nothing says the branch";
  question.conf({1, 2});
  EXPECT_FALSE(fault_of(question));
  question.joints(6);
  EXPECT_EQ(fault_of(question)->field, "conf") << "joints say the branch, too";
  question.conf().clear();
  question.joints_rad(std::vector<double>(11, 0.0));
  EXPECT_EQ(fault_of(question)->field, "joints_rad");
  question.joints_rad(std::vector<double>(12, 0.0));
  EXPECT_FALSE(fault_of(question));
  question.joints(17);
  EXPECT_EQ(fault_of(question)->field, "joints");
  PredictErrors_ none = good_question();
  none.joints(0);
  EXPECT_EQ(ros2::asked(as_received(none), cells())->fault->field, "joints");
}

TEST(Ros2Messages, CountARailInMetres) {
  Cell on_a_rail = *test::small_cell("cell-7");
  std::vector<Joint> joints;
  for (int j = 0; j < on_a_rail.robot.size(); ++j) joints.push_back(on_a_rail.robot.joint(j));
  joints[0].type = JointType::kPrismatic;
  on_a_rail.robot = *Chain::make("on a rail", joints);
  const ServedCells rails = {{"cell-7", std::make_shared<const Cell>(on_a_rail)}};
  PredictErrors_ question = good_question();
  question.joints_rad({1.25, 0.2, 0, 0, 0, 0});
  const auto request = ros2::asked(as_received(question), rails);
  EXPECT_EQ(request->poses()[0].joints_rad()[0], 1250);
  EXPECT_EQ(request->poses()[0].joints_rad()[1], 0.2);

  wire::CorrectTargetReply reply;
  reply.header().trace_id("node-1/3");
  reply.model().cell("cell-7");
  reply.corrections().resize(2);
  reply.corrections()[0].joints_rad({1250, 0.2, 0, 0, 0, 0});
  reply.corrections()[0].error_before_mm(2);
  const auto answer = ros2::answered(reply, rails);
  EXPECT_EQ(answer.id(), "node-1/3");
  EXPECT_EQ(answer.joints_rad()[0], 1.25);
  EXPECT_EQ(answer.joints_rad()[1], 0.2);
  EXPECT_TRUE(std::isnan(answer.joints_rad()[6])) << "no joints reach the second";
  EXPECT_EQ(answer.error_before_m()[0], 0.002);
}

}  // namespace
}  // namespace trammel
