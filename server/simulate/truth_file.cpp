#include <algorithm>
#include <cctype>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/yaml_file.h"
#include "server/robot/cell_file.h"
#include "server/simulate/simulate.h"

namespace trammel {

namespace {

std::string key_of(const Parameter& parameter) {
  std::string unit;  // as a key: `rad/Nmm` is `rad_per_nmm`
  for (const char c : parameter.unit) {
    if (c == '/') unit += "_per_";
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) unit += static_cast<char>(std::tolower(c));
  }
  return unit.empty() ? parameter.name : parameter.name + "_" + unit;
}

void set_values(const YamlMap& map, const ErrorSource& source, Eigen::Ref<Eigen::VectorXd> values) {
  const std::vector<Parameter>& parameters = source.parameters();
  for (const std::string& key : map.keys()) {
    const auto found = std::find_if(parameters.begin(), parameters.end(),
                                    [&](const Parameter& parameter) { return key_of(parameter) == key; });
    if (found == parameters.end()) {
      std::string known;
      for (const Parameter& parameter : parameters) known += " " + key_of(parameter);
      map.refuse(key, refused("unknown parameter").next("known here:" + known));
    }
    values(found - parameters.begin()) = map.number(key) / found->scale;
  }
}

VirtualRobot read_truth(const YamlMap& map, const std::shared_ptr<const Cell>& cell) {
  map.only({"version", "source", "error_sources", "noise", "base", "tools", "course"});
  if (map.integer("version", 0) != 1) map.refuse("version", refused("expected 1").beyond(map.integer("version", 0), 1));
  const YamlMap sources = map.map("error_sources");
  Result<PhysicalModel> model = make_physical_model(cell, sources.keys());
  if (!model) map.refuse("error_sources", Failure(model.error()).as(ErrorCode::kRefused));
  VirtualRobot robot{std::move(*model), cell->tracker.sigma, cell->tracker.sigma_rotation, {}};
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : robot.truth.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (!sources.is_null(source->name())) {
      set_values(sources.map(source->name()), *source, robot.truth.values.segment(first, count));
    }
    first += count;
  }
  if (map.has("noise")) {
    const YamlMap noise = map.map("noise");
    noise.only({"sigma_mm", "sigma_deg"});
    robot.sigma = from_mm(noise.number("sigma_mm", to_mm(robot.sigma)));
    robot.sigma_rotation = from_deg(noise.number("sigma_deg", to_deg(robot.sigma_rotation)));
  }
  if (map.has("course")) {
    const YamlMap course = map.map("course");
    course.only({"seconds_per_pose", "temperature_c", "time_constant_s"});
    robot.course.seconds_per_pose = course.number("seconds_per_pose");
    if (robot.course.seconds_per_pose <= 0)
      course.refuse("seconds_per_pose", refused("must be above 0").beyond(robot.course.seconds_per_pose, 0));
    if (course.has("temperature_c")) {
      const std::vector<double> ends = course.numbers("temperature_c", 2);
      robot.course.temperature_start = ends[0];
      robot.course.temperature_end = ends[1];
    }
    robot.course.temperature_time_constant = course.number("time_constant_s", robot.course.temperature_time_constant);
    if (robot.course.temperature_time_constant <= 0)
      course.refuse("time_constant_s", refused("must be above 0").beyond(robot.course.temperature_time_constant, 0));
  }
  if (map.has("base")) robot.truth.X_WB = read_pose(map.map("base"));
  if (map.has("tools")) {
    const YamlMap tools = map.map("tools");
    for (const std::string& name : tools.keys()) {
      if (!cell->tools.contains(name)) tools.refuse(name, fmt::format("cell {} has no such tool", cell->name));
      robot.truth.tools[name] = read_pose(tools.map(name));
    }
  }
  return robot;
}

}  // namespace

Result<VirtualRobot> read_virtual_robot(const std::string& path, std::shared_ptr<const Cell> cell) {
  return read_text_file(path).and_then([&](const std::string& text) {
    return read_yaml(text, path, [&](const YamlMap& map) { return read_truth(map, cell); });
  });
}

}  // namespace trammel
