#include "server/dds/replicas/batch_copies.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

using Lacks = BatchCopies::Lacks;

BatchCopies::Time soon() { return std::chrono::steady_clock::now() + std::chrono::milliseconds(20); }
BatchCopies::Key key(const std::string& participant) { return {participant, "cell-7", "lt-07"}; }
Status refusal(ErrorCode code) { return failure(code, "no"); }

class BatchCopiesTest : public testing::Test {
 protected:
  /// Tells the follower, and has it answer.
  void tell(const std::string& participant, const std::string& standing, const Status& answer) {
    copies_.answered(participant, copies_.tell(key(participant), standing), answer);
  }
  [[nodiscard]] Lacks lacks(const std::string& participant, const std::string& standing) const {
    return copies_.lacks(key(participant), standing);
  }

  BatchCopies copies_;
};

TEST_F(BatchCopiesTest, WhatEachFollowerSaysIsTold) {
  tell("b", "free", {});
  tell("c", "free", refusal(ErrorCode::kRefused));
  static_cast<void>(copies_.tell(key("d"), "free"));
  const auto wrong = copies_.wait({{"beta", key("b")}, {"gamma", key("c")}, {"delta", key("d")}}, soon());
  EXPECT_FALSE(wrong.contains("beta"));
  EXPECT_EQ(wrong.at("gamma").code, ErrorCode::kRefused);
  EXPECT_EQ(wrong.at("delta").code, ErrorCode::kUnreachable);
}

TEST_F(BatchCopiesTest, NoFollowerAnswersForAnother) {
  const std::uint64_t number = copies_.tell(key("b"), "free");
  copies_.answered("c", number, {});
  EXPECT_EQ(copies_.wait({{"beta", key("b")}}, soon()).count("beta"), 1u);
}

TEST_F(BatchCopiesTest, TheAnswerToAnOlderCopyDoesNotCount) {
  const std::uint64_t released = copies_.tell(key("b"), "free");
  const std::uint64_t discarded = copies_.tell(key("b"), "discarded");
  copies_.answered("b", released, {});
  EXPECT_EQ(copies_.wait({{"beta", key("b")}}, soon()).count("beta"), 1u);
  copies_.answered("b", discarded, {});
  copies_.answered("b", released, refusal(ErrorCode::kRefused));
  EXPECT_TRUE(copies_.wait({{"beta", key("b")}}, soon()).empty());
  EXPECT_EQ(lacks("b", "discarded"), Lacks::kNothing);
  EXPECT_EQ(lacks("b", "free"), Lacks::kStanding);
}

TEST_F(BatchCopiesTest, WhatIsUnderWayIsNotSentOnceMoreUntilSomebodyHasWaitedInVain) {
  EXPECT_EQ(lacks("b", "free"), Lacks::kText);
  const std::uint64_t number = copies_.tell(key("b"), "free");
  EXPECT_EQ(lacks("b", "free"), Lacks::kNothing);
  EXPECT_EQ(copies_.wait({{"beta", key("b")}}, soon()).size(), 1u);
  EXPECT_EQ(lacks("b", "free"), Lacks::kText);
  copies_.answered("b", number, {});
  EXPECT_EQ(lacks("b", "free"), Lacks::kNothing) << "better late than never";
}

TEST_F(BatchCopiesTest, ARefusalThatPassesIsAskedAboutAgainAndALastingOneIsNot) {
  for (const ErrorCode code : {ErrorCode::kBusy, ErrorCode::kInternal}) {
    tell("b", "free", refusal(code));
    EXPECT_EQ(lacks("b", "free"), Lacks::kText) << to_text(code);
  }
  tell("b", "free", refusal(ErrorCode::kRefused));
  EXPECT_EQ(lacks("b", "free"), Lacks::kNothing);
  EXPECT_EQ(copies_.wait({{"beta", key("b")}}, soon()).at("beta").code, ErrorCode::kRefused)
      << "and it goes on to say so";
  EXPECT_EQ(lacks("b", "discarded"), Lacks::kText) << "of another state it may think better";
}

TEST_F(BatchCopiesTest, AFollowerThatHasLostItsStoreGetsTheTextOnceMore) {
  tell("b", "free", {});
  tell("b", "discarded", refusal(ErrorCode::kNotFound));
  EXPECT_EQ(lacks("b", "discarded"), Lacks::kText);
  tell("b", "discarded", refusal(ErrorCode::kNotFound));
  EXPECT_EQ(lacks("b", "discarded"), Lacks::kNothing) << "it does not take the text either";
}

TEST_F(BatchCopiesTest, InDoubtItIsToldWhatBecameOfTheBatchButNotTheTextOnceMore) {
  tell("b", "free", {});
  tell("c", "free", refusal(ErrorCode::kRefused));
  copies_.doubt("c");
  EXPECT_EQ(lacks("b", "free"), Lacks::kNothing);
  EXPECT_EQ(lacks("c", "free"), Lacks::kText);
  copies_.doubt();
  EXPECT_EQ(lacks("b", "free"), Lacks::kStanding);
}

TEST_F(BatchCopiesTest, WhoIsNoFollowerAnyMoreIsForgottenUnlessItsAnswerIsWaitedFor) {
  tell("b", "free", {});
  tell("c", "free", {});
  const std::uint64_t waited_for = copies_.tell(key("d"), "free");
  copies_.forget_all_but({"b"});
  EXPECT_EQ(lacks("b", "free"), Lacks::kNothing);
  EXPECT_EQ(lacks("c", "free"), Lacks::kText);
  copies_.answered("d", waited_for, {});
  EXPECT_EQ(lacks("d", "free"), Lacks::kNothing);
}

TEST_F(BatchCopiesTest, OnceItIsClosedNobodyWaitsLonger) {
  static_cast<void>(copies_.tell(key("b"), "free"));
  copies_.close(soon());
  EXPECT_EQ(copies_.wait({{"beta", key("b")}}, BatchCopies::Time::clock::now() + std::chrono::hours(1)).size(), 1u);
}

}  // namespace
}  // namespace trammel
