#include "clients/cam/rapid/targets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "clients/cam/keep.h"
#include "server/base/units.h"

namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

std::string external_text(const std::array<double, 6>& axes) {
  std::vector<std::string> external;
  for (const double axis : axes)
    external.push_back(std::abs(axis) >= kNoAxis ? "9E+09" : fmt::format("{}", axis));
  return fmt::format("{}", fmt::join(external, ","));
}

}  // namespace

Told<void> Targets::read_joints(const Data& data, ProgramTarget& target) {
  target.coordinates = Coordinates::kJoints;
  if (options_.keep_joints) return because("joint targets are kept (--keep-joints)");
  const Told<JointValue> value = meaning_.joints_of(*data.node, *data.scope);
  if (!value) return because(value.error());
  target.numbers = value->axes;
  note_external(value->external, target);
  rewrite(data.node->parts[0], *data.scope, 0, 6, value->decimals, target);
  return {};
}

Told<void> Targets::read_target(const Data& data, const std::vector<const Use*>& uses,
                                const Data* place, ProgramTarget& target) const {
  const Told<TargetValue> value = meaning_.target_of(*data.node, *data.scope);
  if (!value) return because(value.error());
  // A target must have the same meaning for all callers that reach it.
  for (const Use* use : uses) {
    if (use->data.node == data.node && use->data.scope == data.scope) continue;
    const Told<TargetValue> other = meaning_.target_of(*use->data.node, *use->data.scope);
    if (!other) return because(other.error());
    if (other->numbers != value->numbers) return because("its callers hand over different values");
  }
  target.coordinates = Coordinates::kQuaternion;
  target.numbers = value->numbers;
  note_external(value->external, target);
  target.configuration = configuration_of(value->conf);
  const Data& where = place != nullptr ? *place : data;
  const bool in_place = where.node->kind == Kind::kAggregate && where.node->parts.size() == 4;
  if (in_place) {
    rewrite(where.node->parts[0], *where.scope, 0, 3, value->decimals, target);
    rewrite(where.node->parts[1], *where.scope, 3, 4, value->rotation_decimals, target);
  } else {
    rewrite_whole(*where.node, *value, target);
  }
  return {};
}

/// Adds a line above the statement that keeps the original expression.
void Targets::note_original(const Site& site, const Data& place, ProgramTarget& target) const {
  keep_original(program_.files[site.module].text, site.statement, "!",
                meaning_.text_of(*place.node, *place.scope), target);
}

void Targets::note_external(const std::array<double, 6>& external, ProgramTarget& target) {
  for (int k = 0; k < 6; ++k) {
    if (std::abs(external[static_cast<std::size_t>(k)]) < kNoAxis)
      target.external[k] = external[static_cast<std::size_t>(k)];
  }
}

/// cf1, cf4, cf6: quarter turns of joints 1, 4, 6; cfx: the branch.
Configuration Targets::configuration_of(const std::array<double, 4>& conf) {
  Configuration configuration;
  const double branch = conf[3];
  if (branch >= 0 && branch <= 7 && branch == std::floor(branch))
    configuration.conf = static_cast<int>(branch);
  configuration.near.resize(6);
  constexpr std::array<std::size_t, 3> kJoints = {0, 3, 5};
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::abs(conf[k]) < 100) configuration.near[kJoints[k]] = (conf[k] + 0.5) * kPi / 2;
  }
  return configuration;
}

/// `count` numbers from `first` on are written where the expression stands.
void Targets::rewrite(const Expression& expression, const Scope& scope, std::size_t first,
                      std::size_t count, int decimals, ProgramTarget& target) const {
  const std::string& text = program_.files[scope.module].text;
  if (expression.kind == Kind::kAggregate && expression.parts.size() == count) {
    for (std::size_t k = 0; k < count; ++k) {
      const Expression& part = expression.parts[k];
      const auto written =
          part.kind == Kind::kNumber
              ? read_number(std::string_view(text).substr(part.begin, part.end - part.begin))
              : std::nullopt;
      if (!written) target.folded = true;
      keep({part.begin, part.end}, first + k, written ? written->style : with_decimals(decimals),
           target);
    }
    return;
  }
  NewText whole({expression.begin, expression.end}, "[");
  std::move(whole.numbers(first, count, decimals, ",").text("]")).fold(target);
}

void Targets::rewrite_whole(const Expression& expression, const TargetValue& value,
                            ProgramTarget& target) {
  NewText whole({expression.begin, expression.end}, "");
  write_whole(value, whole);
  std::move(whole).fold(target);
}

void Targets::write_whole(const TargetValue& value, NewText& whole) {
  whole.text("[[").numbers(0, 3, value.decimals, ",").text("],[");
  whole.numbers(3, 4, std::max(value.rotation_decimals, 6), ",");
  whole.text(
      fmt::format("],[{}],[{}]]", fmt::join(value.conf, ","), external_text(value.external)));
}

std::vector<NewLine> Targets::another(const Use& use, bool joints) const {
  const Instruction& motion = *use.motion;
  const std::string& text = program_.files[use.module].text;
  if (motion.name != "movel" && motion.name != "movej" && motion.name != "moveabsj") return {};
  const Expression* place = nullptr;
  bool stops = false;
  for (const Expression& argument : motion.arguments) {
    if (!argument.label.empty()) continue;
    if (place == nullptr) place = &argument;
    stops |= argument.kind == Kind::kName && argument.name == "fine";
  }
  if (place == nullptr || !stops) return {};
  std::string begin = from_line_begin(text, motion.begin, place->begin);
  const std::size_t end = text.find(';', place->end);
  if (begin.empty() || end == std::string::npos) return {};
  const std::string rest = text.substr(place->end, end + 1 - place->end);
  if ((begin + rest).find('\n') != std::string::npos) return {};
  NewText line({}, std::move(begin));
  if (joints) {
    const Told<JointValue> value = meaning_.joints_of(*use.data.node, *use.data.scope);
    if (!value) return {};
    line.text("[[").numbers(0, 6, value->decimals, ",");
    line.text(fmt::format("],[{}]]", external_text(value->external)));
  } else {
    const Told<TargetValue> value = meaning_.target_of(*use.data.node, *use.data.scope);
    if (!value) return {};
    write_whole(*value, line);
  }
  return {std::move(line.text(rest)).line(motion.begin)};
}

}  // namespace trammel::cam::rapid
