#include <gtest/gtest.h>

#include "clients/cam/flow.h"

namespace trammel::cam {
namespace {

using Kind = Step::Kind;

/// Which numbers may hold before each step, where a step with a number in its label sets it.
std::vector<std::set<int>> numbers_before(const std::vector<Step>& steps, bool in_any_order = false) {
  return states_before(
      next_of(steps, in_any_order), entries_of(steps), std::set<int>{0},
      [&](std::size_t s, std::set<int>& state) {
        if (steps[s].kind == Kind::kPlain && !steps[s].label.empty()) state = {std::stoi(steps[s].label)};
      },
      [](std::set<int>& state, const std::set<int>& other) { state.insert(other.begin(), other.end()); });
}
Step sets(int number) { return {Kind::kPlain, std::to_string(number)}; }

TEST(Flow, BranchesComeTogether) {
  const auto before = numbers_before(
      {{Kind::kIf}, sets(1), {Kind::kCase}, sets(2), {Kind::kElse}, sets(3), {Kind::kEnd}, {Kind::kPlain}});
  EXPECT_EQ(before[7], (std::set<int>{1, 2, 3}));
  EXPECT_EQ(before[3], std::set<int>{0});
  EXPECT_EQ(numbers_before({{Kind::kIf}, sets(1), {Kind::kEnd}})[3], (std::set<int>{0, 1}));
}

TEST(Flow, TheEndOfALoopLeadsToItsHead) {
  for (const Kind loop : {Kind::kWhile, Kind::kRepeat})
    EXPECT_EQ(numbers_before({{loop}, {Kind::kPlain}, sets(1), {Kind::kEnd}})[1], (std::set<int>{0, 1}));
  EXPECT_EQ(numbers_before({{Kind::kWhile}, sets(1), {Kind::kExit}, sets(2), {Kind::kEnd}})[1], (std::set<int>{0, 2}));
  EXPECT_EQ(numbers_before({{Kind::kLabel, "a"}, {Kind::kPlain}, sets(1), {Kind::kJumpMaybe, "a"}})[1],
            (std::set<int>{0, 1}));
}

TEST(Flow, CallsLeadThroughTheirRoutineAndBack) {
  const std::vector<Step> steps = {{Kind::kRoutine, "main"},
                                   {Kind::kCall, "sub"},
                                   {Kind::kPlain},
                                   {Kind::kEnd},
                                   {Kind::kRoutine, "sub"},
                                   sets(1),
                                   {Kind::kEnd}};
  const auto before = numbers_before(steps);
  EXPECT_EQ(before[2], std::set<int>{1});
  EXPECT_EQ(before[5], std::set<int>{0});
  EXPECT_EQ(numbers_before(steps, true)[1], (std::set<int>{0, 1}));
}

TEST(Flow, WhatIsOpenOrStrayIsNoFault) {
  const auto before = numbers_before({{Kind::kEnd},
                                      {Kind::kElse},
                                      {Kind::kJump, "nowhere"},
                                      sets(1),
                                      {Kind::kExit},
                                      {Kind::kIf},
                                      {Kind::kCall, "nothing"},
                                      {Kind::kReturn}});
  EXPECT_EQ(before.size(), 9u);
  EXPECT_EQ(before[4], std::set<int>{1});
  EXPECT_EQ(numbers_before({}).size(), 1u);
}

}  // namespace
}  // namespace trammel::cam
