#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "server/compensate/compensated_model.h"

/// What a cell needs from the people who run it, in one sentence. The pages of the service and of
/// the command line say the same.
namespace trammel {

/// When the robot of a model is to be checked again: by the last check of this model, or, before
/// there is one, kUsualInterval after it was measured.
struct NextCheck {
  std::string due;           ///< `2026-12-28`; empty: it cannot be said
  bool passed = false;       ///< that day is over
  std::string verdict = {};  ///< of the last check of this model; empty: none was made
  std::string why = {};      ///< the check's reason for its verdict
};
/// `last_check`: in the form of health_json(); empty, or of another model: none. `now`: Unix time,
/// s.
[[nodiscard]] NextCheck next_check(const ModelProvenance& model, const std::string& last_check,
                                   std::int64_t now);

/// The facts about a cell on which its needs depend.
struct NeedFacts {
  std::string cell;
  const CompensatedModel* model = nullptr;  ///< in force; null: none
  std::string dark_because = {};  ///< why nobody gets an answer; empty: it is answered for
  std::string last_check = {};    ///< in the form of health_json(); empty: none
  bool in_training = false;       ///< its first model is being made
  std::size_t kept_out = 0;       ///< batches in quarantine
  std::int64_t now = 0;           ///< Unix time, s
};

struct CellNeed {
  enum class Urgency { kFine, kSoon, kNow };
  Urgency urgency = Urgency::kFine;
  std::string sentence;  ///< `Its check was due on 2026-11-20.`
  std::string action;    ///< `measure the poses of trammel plan --check 12, ...`; empty: nothing
};
[[nodiscard]] CellNeed need_of(const NeedFacts& facts);

/// `fine`, `soon`, `now`.
[[nodiscard]] const char* to_text(CellNeed::Urgency urgency);
[[nodiscard]] nlohmann::ordered_json need_json(const CellNeed& need);
/// A badge as HTML: `fine` in green, `see to it soon`, `act now` in red.
[[nodiscard]] std::string need_badge(const std::string& urgency);

}  // namespace trammel
