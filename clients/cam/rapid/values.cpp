#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "clients/cam/rapid/interpreter.h"
#include "server/base/plain_text.h"
#include "server/base/units.h"

// Numbers, targets and joints that expressions stand for.
namespace trammel::cam::rapid {

namespace {

using Kind = Expression::Kind;

constexpr int kDeepest = 60;  // names that stand for names

}  // namespace

Told<double> Interpreter::operation(const Expression& expression, const Scope& scope,
                                    int depth) const {
  const Told<double> left = number_of(expression.parts[0], scope, depth + 1);
  if (!left) return left;
  if (expression.kind == Kind::kUnary) return expression.sign == '-' ? -*left : *left;
  const Told<double> right = number_of(expression.parts[1], scope, depth + 1);
  if (!right) return right;
  double value = 0;
  switch (expression.sign) {
    case '+':
      value = *left + *right;
      break;
    case '-':
      value = *left - *right;
      break;
    case '*':
      value = *left * *right;
      break;
    default:
      value = *left / *right;
  }
  if (!std::isfinite(value)) return because("a number is not finite");
  return value;
}

Told<double> Interpreter::number_of(const Expression& expression, const Scope& scope,
                                    int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kNumber) return expression.value;
  if (expression.kind == Kind::kUnary || expression.kind == Kind::kBinary)
    return operation(expression, scope, depth);
  if (expression.kind == Kind::kName && expression.name == "pi" && !find("pi", scope)) return kPi;
  if (expression.kind != Kind::kName && expression.kind != Kind::kField &&
      expression.kind != Kind::kElement)
    return because(fmt::format("'{}' is not constant", shown_short(text_of(expression, scope))));
  const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
  if (!data) return because(data.error());
  const Data& one = data->front();
  if (data->size() > 1)
    return because(fmt::format("an index chooses {}", shown_short(text_of(expression, scope))));
  if (one.declared != nullptr && one.declared->storage == Storage::kPers &&
      one.declared->type == "num")
    return because(
        fmt::format("{} is persistent: it may be set at any time", shown(one.declared->name)));
  return number_of(*one.node, *one.scope, depth + 1);
}

Told<std::vector<double>> Interpreter::numbers_of(const Expression& expression, std::size_t count,
                                                  const Scope& scope, int* decimals,
                                                  int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kAggregate) {
    if (expression.parts.size() != count)
      return because(fmt::format("{} numbers where {} are due", expression.parts.size(), count));
    std::vector<double> numbers;
    for (const Expression& part : expression.parts) {
      const Told<double> number = number_of(part, scope, depth + 1);
      if (!number) return because(number.error());
      numbers.push_back(*number);
      const std::string& text = files_[scope.module].text;
      const auto written =
          part.kind == Kind::kNumber
              ? read_number(std::string_view(text).substr(part.begin, part.end - part.begin))
              : std::nullopt;
      if (written && written->style.exponent == 0)
        *decimals = std::max(*decimals, written->style.decimals);
    }
    return numbers;
  }
  const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
  if (!data) return because(data.error());
  if (data->size() != 1) return because("an index chooses it");
  if (data->front().node == &expression) return because("it is not written out");
  return numbers_of(*data->front().node, count, *data->front().scope, decimals, depth + 1);
}

Told<TargetValue> Interpreter::offset_of(const Expression& call, const Scope& scope,
                                         int depth) const {
  if (call.parts.size() < 4)
    return because(fmt::format("{} with {} arguments", call.name.text(), call.parts.size()));
  Told<TargetValue> base = target_of(call.parts[0], scope, depth + 1);
  if (!base) return base;
  Vector3 d;
  for (std::size_t k = 0; k < 3; ++k) {
    const Told<double> number = number_of(call.parts[k + 1], scope, depth + 1);
    if (!number) return because(number.error());
    d(static_cast<Eigen::Index>(k)) = *number;
  }
  if (call.name == "offs") {
    for (std::size_t k = 0; k < 3; ++k) base->numbers[k] += d(static_cast<Eigen::Index>(k));
    return base;
  }
  // RelTool: along the tool's axes, then about x, the new y, the new z.
  Vector3 turn = Vector3::Zero();
  for (std::size_t k = 4; k < call.parts.size(); ++k) {
    const Expression& part = call.parts[k];
    const std::size_t axis =
        std::string("xyz").find(part.label.text().size() == 2 ? part.label.text()[1] : '?');
    if (!part.label.text().starts_with("r") || axis == std::string::npos)
      return because(fmt::format("RelTool with '{}'", shown(part.label.text())));
    const Told<double> number = number_of(part, scope, depth + 1);
    if (!number) return because(number.error());
    turn(static_cast<Eigen::Index>(axis)) = from_deg(*number);
  }
  Pose pose = pose_of(Coordinates::kQuaternion, base->numbers);
  pose.translate(d * from_mm(1));
  pose.rotate(Eigen::AngleAxisd(turn.x(), Vector3::UnitX()) *
              Eigen::AngleAxisd(turn.y(), Vector3::UnitY()) *
              Eigen::AngleAxisd(turn.z(), Vector3::UnitZ()));
  base->numbers = cam::numbers_of(Coordinates::kQuaternion, pose, base->numbers);
  return base;
}

Told<TargetValue> Interpreter::target_of(const Expression& expression, const Scope& scope,
                                         int depth) const {
  if (depth > kDeepest) return because("it stands for itself");
  if (expression.kind == Kind::kCall && (expression.name == "offs" || expression.name == "reltool"))
    return offset_of(expression, scope, depth);
  if (expression.kind != Kind::kAggregate) {
    const Told<std::vector<Data>> data = data_of(expression, scope, depth + 1);
    if (!data) return because(data.error());
    if (data->size() != 1)
      return because(fmt::format("an index chooses {}", shown_short(text_of(expression, scope))));
    if (data->front().node == &expression) return because("it is not understood");
    return target_of(*data->front().node, *data->front().scope, depth + 1);
  }
  if (expression.parts.size() != 4)
    return because(fmt::format("a robtarget of {} parts", expression.parts.size()));
  TargetValue value;
  const auto read = [&](std::size_t part, std::size_t count, int* decimals) {
    return numbers_of(expression.parts[part], count, scope, decimals, depth + 1);
  };
  int ignored = 0;
  const Told<std::vector<double>> position = read(0, 3, &value.decimals);
  if (!position) return because(position.error());
  const Told<std::vector<double>> rotation = read(1, 4, &value.rotation_decimals);
  if (!rotation) return because(rotation.error());
  const Told<std::vector<double>> conf = read(2, 4, &ignored);
  if (!conf) return because(conf.error());
  const Told<std::vector<double>> external = read(3, 6, &ignored);
  if (!external) return because(external.error());
  value.numbers = *position;
  value.numbers.insert(value.numbers.end(), rotation->begin(), rotation->end());
  const double length =
      Eigen::Vector4d((*rotation)[0], (*rotation)[1], (*rotation)[2], (*rotation)[3]).norm();
  if (std::abs(length - 1) > 0.01)
    return because(fmt::format("a quaternion of length {:.4f}", length));
  std::copy(conf->begin(), conf->end(), value.conf.begin());
  std::copy(external->begin(), external->end(), value.external.begin());
  return value;
}

Told<JointValue> Interpreter::joints_of(const Expression& expression, const Scope& scope) const {
  if (expression.kind != Kind::kAggregate || expression.parts.size() != 2)
    return because("a jointtarget that is not written out");
  JointValue value;
  int ignored = 0;
  const Told<std::vector<double>> axes = numbers_of(expression.parts[0], 6, scope, &value.decimals);
  if (!axes) return because(axes.error());
  const Told<std::vector<double>> external = numbers_of(expression.parts[1], 6, scope, &ignored);
  if (!external) return because(external.error());
  value.axes = *axes;
  std::copy(external->begin(), external->end(), value.external.begin());
  return value;
}

}  // namespace trammel::cam::rapid
