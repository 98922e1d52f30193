#include "server/report/cell_needs.h"

#include <fmt/format.h>

#include <cctype>
#include <vector>

#include "server/compensate/model_notes.h"
#include "server/health/health_check.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;
using Urgency = CellNeed::Urgency;

constexpr int kPosesOfCheck = 12;  // that are proposed

std::string text_at(const ordered_json& json, const char* key) {
  return json.is_object() && json.contains(key) && json[key].is_string()
             ? json[key].get<std::string>()
             : "";
}

/// What a check says to do about the changes that it found.
std::string actions_of(const std::string& check) {
  const ordered_json found = ordered_json::parse(check, nullptr, false);
  if (!found.is_object() || !found.contains("budget") || !found["budget"].is_object()) return "";
  const ordered_json& budget = found["budget"];
  if (!budget.contains("lines") || !budget["lines"].is_array()) return "";
  std::string actions;
  for (const ordered_json& line : budget["lines"]) {
    const std::string action = text_at(line, "action");
    if (!action.empty() && actions.find(action) == std::string::npos)
      actions += (actions.empty() ? "" : ", ") + action;
  }
  return actions;
}

std::string with_full_stop(std::string text) {
  if (text.empty()) return text;
  text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text.back() == '.' ? text : text + ".";
}

std::string check_it(const std::string& cell, int poses) {
  return fmt::format(
      "measure the poses of trammel plan --check {}, then trammel check {} BATCH --service", poses,
      cell);
}

CellNeed need_of_dark(const NeedFacts& facts) {
  if (facts.in_training)
    return {Urgency::kSoon, "Its first model is being made: nobody gets an answer until then.",
            "wait for it: trammel watch " + facts.cell};
  return {Urgency::kNow, with_full_stop("nobody gets an answer for it: " + facts.dark_because),
          facts.model == nullptr
              ? fmt::format("measure it, then trammel submit {} BATCH", facts.cell)
              : std::string("trammel doctor says what is wrong with the service")};
}

CellNeed need_of_check(const NeedFacts& facts, const NextCheck& next) {
  if (next.verdict == "changed") {
    const std::string repair = actions_of(facts.last_check);
    return {
        Urgency::kNow, with_full_stop("the robot has changed: " + next.why),
        (repair.empty() ? "" : repair + "; ") + "measure it anew and train before parts are made"};
  }
  if (next.verdict == "cannot_tell")
    return {Urgency::kSoon,
            with_full_stop("the last check could not tell whether it changed: " + next.why),
            check_it(facts.cell, 2 * kPosesOfCheck)};
  if (next.passed)
    return {Urgency::kSoon, fmt::format("Its check was due by {}.", next.due),
            check_it(facts.cell, kPosesOfCheck)};
  if (next.due.empty())
    return {Urgency::kSoon, "When it was measured is not known, so its age is not either.",
            check_it(facts.cell, kPosesOfCheck)};
  return {Urgency::kFine,
          next.verdict.empty() ? fmt::format("Nothing to do before its check by {}.", next.due)
                               : fmt::format("Checked and healthy, next check by {}.", next.due),
          ""};
}

}  // namespace

NextCheck next_check(const ModelProvenance& model, const std::string& last_check,
                     std::int64_t now) {
  const std::int64_t from = model.measured_at.value_or(model.trained_at);
  NextCheck next{from > 0 ? shown_day(from + kUsualInterval) : ""};
  const ordered_json check = ordered_json::parse(last_check, nullptr, false);
  if (text_at(check, "model") == model.id && !text_at(check, "verdict").empty()) {
    next.verdict = text_at(check, "verdict");
    next.why = text_at(check, "why");
    if (const std::string due = text_at(check, "due"); !due.empty()) next.due = due;
  }
  next.passed = !next.due.empty() && shown_day(now) > next.due;
  return next;
}

CellNeed need_of(const NeedFacts& facts) {
  if (!facts.dark_because.empty() || facts.in_training) return need_of_dark(facts);
  if (facts.model == nullptr)
    return {Urgency::kNow, "It has no model in force.",
            fmt::format("measure it, then trammel submit {} BATCH", facts.cell)};
  const NextCheck next = next_check(facts.model->provenance(), facts.last_check, facts.now);
  CellNeed need = need_of_check(facts, next);
  if (need.urgency == Urgency::kNow) return need;
  if (const auto stop = stop_of(*facts.model))
    return {Urgency::kNow, with_full_stop(stop->text),
            "do not correct parts with it before that is cleared up"};
  if (need.urgency == Urgency::kFine && facts.kept_out > 0)
    return {Urgency::kSoon,
            fmt::format("{} batch{} kept out of training.", facts.kept_out,
                        facts.kept_out == 1 ? " is" : "es are"),
            "see on the cell's page why, then trammel release or trammel discard"};
  return need;
}

const char* to_text(CellNeed::Urgency urgency) {
  switch (urgency) {
    case Urgency::kFine:
      return "fine";
    case Urgency::kSoon:
      return "soon";
    case Urgency::kNow:
      return "now";
  }
  return "";
}

ordered_json need_json(const CellNeed& need) {
  return {{"urgency", to_text(need.urgency)}, {"sentence", need.sentence}, {"action", need.action}};
}

std::string need_badge(const std::string& urgency) {
  if (urgency == "fine") return "<span class=\"badge good\">fine</span>";
  if (urgency == "now") return "<span class=\"badge bad\">act now</span>";
  return urgency == "soon" ? "<span class=\"badge soon\">see to it</span>" : "";
}

}  // namespace trammel
