#include <algorithm>
#include <cctype>

#include "server/base/letters.h"
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
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) unit += lower(c);
  }
  return unit.empty() ? parameter.name : parameter.name + "_" + unit;
}

void set_values(const YamlMap& map, const ErrorSource& source, Eigen::Ref<Eigen::VectorXd> values) {
  const std::vector<Parameter>& parameters = source.parameters();
  for (const std::string& key : map.keys()) {
    const auto found =
        std::find_if(parameters.begin(), parameters.end(),
                     [&](const Parameter& parameter) { return key_of(parameter) == key; });
    if (found == parameters.end()) {
      std::string known;
      for (const Parameter& parameter : parameters) known += " " + key_of(parameter);
      map.refuse(key, refused("unknown parameter").next("known here:" + known));
    }
    values(found - parameters.begin()) = map.number(key) / found->scale;
  }
}

void read_noise(const YamlMap& noise, VirtualRobot& robot) {
  noise.only({"sigma_mm", "sigma_deg"});
  robot.sigma = from_mm(noise.number("sigma_mm", to_mm(robot.sigma)));
  robot.sigma_rotation = from_deg(noise.number("sigma_deg", to_deg(robot.sigma_rotation)));
}

void read_course(const YamlMap& map, MeasuringCourse& course) {
  map.only({"seconds_per_pose", "temperature_c", "time_constant_s"});
  course.seconds_per_pose = map.number("seconds_per_pose");
  if (course.seconds_per_pose <= 0)
    map.refuse("seconds_per_pose", refused("must be above 0").beyond(course.seconds_per_pose, 0));
  if (map.has("temperature_c")) {
    const std::vector<double> ends = map.numbers("temperature_c", 2);
    course.temperature_start = ends[0];
    course.temperature_end = ends[1];
  }
  course.temperature_time_constant =
      map.number("time_constant_s", course.temperature_time_constant);
  if (course.temperature_time_constant <= 0)
    map.refuse("time_constant_s",
               refused("must be above 0").beyond(course.temperature_time_constant, 0));
}

void read_tools(const YamlMap& map, const Cell& cell, PhysicalModel& truth) {
  for (const std::string& name : map.keys()) {
    if (!cell.tools.contains(name))
      map.refuse(name, fmt::format("cell {} has no such tool", cell.name));
    truth.tools[name] = read_pose(map.map(name));
  }
}

/// The values of each source that the file names.
void read_sources(const YamlMap& sources, PhysicalModel& truth) {
  Eigen::Index first = 0;
  for (const ErrorSourcePtr& source : truth.sources) {
    const auto count = static_cast<Eigen::Index>(source->parameters().size());
    if (!sources.is_null(source->name()))
      set_values(sources.map(source->name()), *source, truth.values.segment(first, count));
    first += count;
  }
}

VirtualRobot read_truth(const YamlMap& map, const std::shared_ptr<const Cell>& cell) {
  map.only({"version", "source", "error_sources", "noise", "base", "tools", "course"});
  if (map.integer("version", 0) != 1)
    map.refuse("version", refused("expected 1").beyond(map.integer("version", 0), 1));
  const YamlMap sources = map.map("error_sources");
  Result<PhysicalModel> model = make_physical_model(cell, sources.keys());
  if (!model) {
    Error wrong = model.error();
    wrong.field.clear();  // the fault belongs to the key
    map.refuse("error_sources", Failure(std::move(wrong)).as(ErrorCode::kRefused));
  }
  VirtualRobot robot{std::move(*model), cell->tracker.sigma, cell->tracker.sigma_rotation, {}};
  read_sources(sources, robot.truth);
  if (map.has("noise")) read_noise(map.map("noise"), robot);
  if (map.has("course")) read_course(map.map("course"), robot.course);
  if (map.has("base")) robot.truth.X_WB = read_pose(map.map("base"));
  if (map.has("tools")) read_tools(map.map("tools"), *cell, robot.truth);
  return robot;
}

}  // namespace

Result<VirtualRobot> read_virtual_robot(const std::string& path, std::shared_ptr<const Cell> cell) {
  return read_text_file(path).and_then([&](const std::string& text) {
    return read_yaml(text, path, [&](const YamlMap& map) { return read_truth(map, cell); });
  });
}

}  // namespace trammel
