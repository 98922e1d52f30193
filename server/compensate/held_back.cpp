#include "server/compensate/held_back.h"

#include <array>
#include <utility>

namespace trammel {

namespace {

constexpr std::array<std::pair<HeldBack, const char*>, 4> kReasons = {
    {{HeldBack::kNo, ""},
     {HeldBack::kFewJudges, "few_judges"},
     {HeldBack::kStopNote, "stop_note"},
     {HeldBack::kStepLimit, "step_limit"}}};

}  // namespace

const char* to_text(HeldBack reason) {
  for (const auto& [value, text] : kReasons) {
    if (value == reason) return text;
  }
  return "";
}

HeldBack held_back_of(std::string_view text) {
  for (const auto& [value, name] : kReasons) {
    if (text == name) return value;
  }
  return HeldBack::kNo;
}

}  // namespace trammel
