#include "clients/cam/rapid/state.h"

#include <fmt/format.h>

#include <algorithm>

#include "clients/cam/rapid/motions.h"

namespace trammel::cam::rapid {

namespace {

/// A pair of instructions between which the arm does not follow its motions.
struct GiveWay {
  const char *begins, *label;  ///< empty label: with any
  const char* ends;            ///< as names of instructions begin
  const char* why;
};
const std::array<GiveWay, 3>& give_ways() {
  static const std::array<GiveWay, 3> kAll = {
      {{"singarea", "lockaxis4", "singarea",
        "SingArea\\LockAxis4 holds axis 4, so that the orientation is not reached"},
       {"fcact", "", "fcdeact", "FCAct: a force decides where the tool goes"},
       {"cssact", "", "cssdeact", "CSSAct: the arm gives way, and the model knows a stiff one"}}};
  return kAll;
}

}  // namespace

/// If a routine ends with displaced targets, all motions may be displaced.
void Setting::note_displacements() {
  for (std::size_t m = 0; m < modules_.size(); ++m) {
    std::map<int, std::string> open;
    for (const Instruction& instruction : modules_[m].instructions) {
      if (displaces(instruction)) open[instruction.routine] = displacement(m, instruction);
      if (instruction.name == "pdispoff") open.erase(instruction.routine);
    }
    for (const auto& [routine, why] : open)
      open_displacement_ = why + ", and is not switched off where it stands";
  }
}

void Setting::set(const Place& place, State& state) {
  if (place.assignment != nullptr) {
    Settings settings = *settings_[state.settings];
    meaning_.set(*place.assignment, settings);
    state.settings = known_settings(std::move(settings));
  }
  if (place.instruction == nullptr) return;
  const Instruction& instruction = *place.instruction;
  if (instruction.name == "gripload") state.load = tools_.load_set(place.module, instruction);
  if (instruction.name == "pdispoff") state.displaced = 0;
  if (instruction.name == "eoffsoff") state.external_displaced = 0;
  for (std::size_t k = 0; k < give_ways().size(); ++k) {
    const GiveWay& way = give_ways()[k];
    if (instruction.name.starts_with(way.ends)) state.given_way[k] = 0;
    if (instruction.name != way.begins ||
        (*way.label != '\0' && !has_label(instruction, way.label)))
      continue;
    state.given_way[k] = known_displacement(
        fmt::format("{} ({})", way.why, meaning_.place_of(place.module, instruction.line)));
  }
  if (instruction.name == "confl") state.lines = confs_of(instruction);
  if (instruction.name == "confj") state.axes = confs_of(instruction);
  if (displaces(instruction))
    state.displaced = known_displacement(displacement(place.module, instruction));
  if (displaces_external(instruction))
    state.external_displaced = known_displacement(displacement(place.module, instruction));
}

void Setting::join(State& state, const State& other, const std::string& by) {
  state.displaced = std::max(state.displaced, other.displaced);
  state.external_displaced = std::max(state.external_displaced, other.external_displaced);
  for (std::size_t k = 0; k < state.given_way.size(); ++k)
    state.given_way[k] = std::max(state.given_way[k], other.given_way[k]);
  if (state.settings != other.settings)
    state.settings =
        known_settings(on_both_ways(*settings_[state.settings], *settings_[other.settings]));
  if (state.lines != other.lines) state.lines = Confs::kUndecided;
  if (state.axes != other.axes) state.axes = Confs::kUndecided;
  if (state.load == other.load) return;
  state.load = tools_.undecided_load(
      state.load, by.empty()
                      ? "GripLoad: a branch, a loop or a caller decides what the robot carries"
                      : fmt::format("GripLoad: {} may change what the robot carries", by));
}

bool Setting::displaces(const Instruction& instruction) {
  return instruction.name == "pdispon" || instruction.name == "pdispset";
}

bool Setting::displaces_external(const Instruction& instruction) {
  return instruction.name == "eoffson" || instruction.name == "eoffsset";
}

std::string Setting::displacement(std::size_t module, const Instruction& instruction) const {
  const char* what = displaces_external(instruction) ? "its external axes" : "it";
  return fmt::format("{} displaces {} ({})", instruction.spelled, what,
                     meaning_.place_of(module, instruction.line));
}

std::size_t Setting::known_displacement(const std::string& why) {
  const auto known = std::find(displacements_.begin(), displacements_.end(), why);
  if (known != displacements_.end())
    return static_cast<std::size_t>(known - displacements_.begin());
  displacements_.push_back(why);
  return displacements_.size() - 1;
}

std::size_t Setting::known_settings(Settings settings) {
  const auto [known, fresh] = settings_at_.emplace(std::move(settings), settings_.size());
  if (fresh) settings_.push_back(&known->first);
  return known->second;
}

/// The settings that hold on both ways; nullptr where they differ.
Settings Setting::on_both_ways(const Settings& one, const Settings& other) {
  Settings both;
  for (const Settings* settings : {&one, &other}) {
    const Settings& beside = settings == &one ? other : one;
    for (const auto& [of, parts] : *settings) {
      const auto there = beside.find(of);
      for (const auto& [fields, assignment] : parts) {
        const auto same = there == beside.end() ? parts.end() : there->second.find(fields);
        const bool agrees =
            there != beside.end() && same != there->second.end() && same->second == assignment;
        both[of][fields] = agrees ? assignment : nullptr;
      }
    }
  }
  return both;
}

Confs Setting::confs_of(const Instruction& instruction) {
  return has_label(instruction, "off") ? Confs::kOff : Confs::kOn;
}

}  // namespace trammel::cam::rapid
