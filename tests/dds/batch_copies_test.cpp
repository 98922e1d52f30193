#include "server/dds/replicas/batch_copies.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

BatchCopies::Time soon() { return std::chrono::steady_clock::now() + std::chrono::milliseconds(20); }

TEST(BatchCopiesTest, WhatEachFollowerSaysIsTold) {
  BatchCopies copies;
  const auto numbers = copies.expect({"b", "c", "d"});
  copies.answered("b", numbers.at("b"), {});
  copies.answered("c", numbers.at("c"), failure(ErrorCode::kRefused, "another batch of this name"));
  const auto wrong = copies.wait(numbers, soon());
  EXPECT_FALSE(wrong.contains("b"));
  EXPECT_EQ(wrong.at("c").code, ErrorCode::kRefused);
  EXPECT_EQ(wrong.at("d").code, ErrorCode::kUnreachable);
}

TEST(BatchCopiesTest, NoFollowerAnswersForAnother) {
  BatchCopies copies;
  const auto numbers = copies.expect({"b", "c"});
  copies.answered("c", numbers.at("b"), {});
  copies.answered("c", numbers.at("c"), {});
  EXPECT_EQ(copies.wait(numbers, soon()).count("b"), 1u);
}

TEST(BatchCopiesTest, AnAnswerThatComesTooLateIsNoAnswerToTheNextCopy) {
  BatchCopies copies;
  const auto first = copies.expect({"b"});
  EXPECT_EQ(copies.wait(first, soon()).size(), 1u);
  const auto second = copies.expect({"b"});
  copies.answered("b", first.at("b"), {});
  EXPECT_EQ(copies.wait(second, soon()).size(), 1u);
}

}  // namespace
}  // namespace trammel
