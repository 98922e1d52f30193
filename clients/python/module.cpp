// The extension module of the Python package: libtrammel with NumPy arrays. Users see
// trammel/__init__.py.
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "trammel/offline.h"
#include "trammel/service.h"

namespace trammel::python {
namespace {

namespace py = pybind11;
using namespace pybind11::literals;
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Whole = py::array_t<int, py::array::c_style | py::array::forcecast>;

/// An error on its way into Python.
struct Failed {
  api::Error error;
};

template <typename T>
T value_or_raise(api::Result<T> result) {
  if (!result) throw Failed{std::move(result.error())};
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

[[noreturn]] void refuse(const std::string& argument, const std::string& message) {
  api::Error error;
  error.code = api::ErrorCode::kUsage;
  error.field = argument;
  error.message = message;
  error.sentence = argument + ": " + message;
  throw Failed{std::move(error)};
}

/// Without the interpreter's lock.
template <typename Work>
auto unlocked(const Work& work) {
  const py::gil_scoped_release released;
  return work();
}

py::dict to_python(const api::Error& error) {
  py::list also;
  for (const api::Error& other : error.also) also.append(to_python(other));
  return py::dict("code"_a = api::to_text(error.code), "message"_a = error.message,
                  "file"_a = error.file, "row"_a = error.row, "column"_a = error.field,
                  "value"_a = error.value, "limit"_a = error.limit, "text"_a = error.text,
                  "next"_a = error.next, "also"_a = also, "sentence"_a = error.sentence);
}

/// Raises the exception of trammel.errors that fits.
void raise(const api::Error& error) {
  const py::object exception =
      py::module_::import("trammel.errors").attr("exception_of")(to_python(error));
  PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(exception.ptr())), exception.ptr());
}

/// The exception that a Python progress function raised; the work then ends.
class Told {
 public:
  explicit Told(py::object listener) : listener_(std::move(listener)) {}
  bool operator()(const std::string& stage, double share) {
    const py::gil_scoped_acquire lock;
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (!listener_.is_none()) listener_(stage, share);
    } catch (py::error_already_set& raised) {
      raised_ = std::move(raised);
      return false;
    }
    return true;
  }
  void raise_again() {
    if (raised_) throw std::move(*raised_);
  }

 private:
  py::object listener_;
  std::optional<py::error_already_set> raised_;
};

/// The result of `work(progress)`, which runs without the interpreter's lock; or the exception of
/// the progress function.
template <typename Work>
auto told_of(const py::object& listener, const Work& work) {
  Told told(listener);
  auto result = unlocked([&] {
    return work([&](const std::string& stage, double share) { return told(stage, share); });
  });
  told.raise_again();
  return value_or_raise(std::move(result));
}

/// A table of `columns` numbers a row, N x columns; one row may come without its brackets.
std::vector<double> rows_of(const Numbers& array, const std::string& argument,
                            py::ssize_t columns) {
  const bool fits = (array.ndim() == 2 && array.shape(1) == columns) ||
                    (array.ndim() == 1 && array.shape(0) == columns);
  if (!fits) refuse(argument, "an array of shape (N, " + std::to_string(columns) + ") is needed");
  return {array.data(), array.data() + array.size()};
}

/// An array of shape (N, columns), or (N,) for one column, from the data that `of` points to in
/// each item.
template <typename Item, typename Of>
py::array_t<double> table(const std::vector<Item>& items, py::ssize_t columns, const Of& of) {
  const auto rows = static_cast<py::ssize_t>(items.size());
  py::array_t<double> array(columns == 1 ? std::vector<py::ssize_t>{rows}
                                         : std::vector<py::ssize_t>{rows, columns});
  double* to = array.mutable_data();
  for (const Item& item : items) to = std::copy_n(of(item), columns, to);
  return array;
}

// A figure of each item, by its kind.

template <typename Item>
py::array figure_of(const std::vector<Item>& items, api::Pose Item::*pose) {
  py::array_t<double> array({static_cast<py::ssize_t>(items.size()), py::ssize_t{7}});
  double* to = array.mutable_data();
  for (const Item& item : items) {
    to = std::copy_n((item.*pose).xyz_mm.data(), 3, to);
    to = std::copy_n((item.*pose).q_wxyz.data(), 4, to);
  }
  return array;
}

template <typename Item>
py::array figure_of(const std::vector<Item>& items, std::array<double, 3> Item::*vector) {
  return table(items, 3, [&](const Item& item) { return (item.*vector).data(); });
}

template <typename Item>
py::array figure_of(const std::vector<Item>& items,
                    std::optional<std::array<double, 3>> Item::*vector) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  static const std::array<double, 3> kNotLearned = {kNaN, kNaN, kNaN};
  return table(items, 3, [&](const Item& item) {
    return (item.*vector ? *(item.*vector) : kNotLearned).data();
  });
}

template <typename Item>
py::array figure_of(const std::vector<Item>& items, std::array<double, 9> Item::*matrix) {
  return table(items, 9, [&](const Item& item) { return (item.*matrix).data(); })
      .reshape({static_cast<py::ssize_t>(items.size()), py::ssize_t{3}, py::ssize_t{3}});
}

template <typename Item, typename Number>
py::array figure_of(const std::vector<Item>& items, Number Item::*number) {
  py::array_t<Number> array(static_cast<py::ssize_t>(items.size()));
  for (std::size_t i = 0; i < items.size(); ++i) array.mutable_data()[i] = items[i].*number;
  return array;
}

template <typename Item, typename Figures>
py::dict figures_of(const std::vector<Item>& items, const Figures& figures) {
  py::dict all;
  exchange::each_figure(
      figures, [&](const auto& figure) { all[figure.name] = figure_of(items, figure.value); });
  return all;
}

template <typename Item, typename Of>
py::list texts(const std::vector<Item>& items, const Of& of) {
  py::list list;
  for (const Item& item : items) list.append(of(item));
  return list;
}

py::dict to_python(const std::vector<api::Prediction>& items) {
  return figures_of(items, exchange::kPredictionFigures);
}

py::dict to_python(const std::vector<api::CorrectedTarget>& items, std::size_t joints) {
  using T = api::CorrectedTarget;
  const std::vector<double> none(joints, std::numeric_limits<double>::quiet_NaN());
  py::dict all = figures_of(items, exchange::kCorrectionFigures);
  all["status"] = texts(items, [](const T& t) { return t.status; });
  all["pose"] = figure_of(items, &T::commanded);
  all["joints_deg"] = table(items, static_cast<py::ssize_t>(joints), [&](const T& t) {
    return t.joints_deg.size() == joints ? t.joints_deg.data() : none.data();
  });
  all["message"] = texts(items, [](const T& t) { return t.message; });
  return all;
}

py::list to_python(const std::vector<api::Note>& notes) {
  return texts(notes, [](const api::Note& note) {
    return py::dict("code"_a = note.code, "severity"_a = note.severity, "text"_a = note.text);
  });
}

py::dict to_python(const api::ModelFacts& facts) {
  return py::dict("id"_a = facts.id, "hash"_a = facts.hash, "cell"_a = facts.cell,
                  "level"_a = facts.level, "batch"_a = facts.batch,
                  "training_poses"_a = facts.training_poses, "version"_a = facts.version,
                  "in_force"_a = facts.in_force, "notes"_a = to_python(facts.notes),
                  "budget"_a = facts.budget);
}

py::dict to_python(const api::Figures& f) {
  py::dict axis;
  const char* const names[] = {"x", "y", "z"};
  for (std::size_t k = 0; k < 3; ++k)
    axis[names[k]] = py::dict("mean_mm"_a = f.axis_mean_mm[k], "std_mm"_a = f.axis_stddev_mm[k]);
  return py::dict("rms_mm"_a = f.rms_mm, "mean_mm"_a = f.mean_mm, "p997_mm"_a = f.p997_mm,
                  "max_mm"_a = f.max_mm, "axis"_a = axis);
}

py::dict to_python(const api::OrientationErrors& o) {
  const auto level = [](double rms) { return py::dict("rms_deg"_a = rms); };
  py::dict out("poses"_a = o.poses, "nominal"_a = level(o.nominal_rms_deg),
               "calibrated"_a = level(o.calibrated_rms_deg),
               "compensated"_a = level(o.compensated_rms_deg));
  if (o.coverage_95) out["coverage_95"] = *o.coverage_95;
  return out;
}

/// The keys of `trammel evaluate --json`.
py::dict to_python(const api::Evaluation& e) {
  py::dict out("poses"_a = e.poses);
  out.attr("update")(to_python(e.compensated));
  out["levels"] =
      py::dict("nominal"_a = to_python(e.nominal), "calibrated"_a = to_python(e.calibrated),
               "compensated"_a = to_python(e.compensated));
  out["coverage_95"] = e.coverage_95;
  if (e.coverage_95_stated) out["coverage_95_stated"] = *e.coverage_95_stated;
  out["in_domain"] = e.in_domain;
  if (e.nlpd) out["nlpd"] = *e.nlpd;
  if (e.orientation) out["orientation"] = to_python(*e.orientation);
  if (!e.doubt_of_bias.empty()) out["doubt_of_bias"] = e.doubt_of_bias;
  if (e.trained_on > 0) out["trained_on"] = e.trained_on;
  return out;
}

py::dict to_python(const api::Job& job) {
  return py::dict("id"_a = job.id, "cell"_a = job.cell, "stage"_a = job.stage, "what"_a = job.what,
                  "share"_a = job.share, "verdict"_a = job.verdict, "version"_a = job.version,
                  "in_force"_a = job.in_force, "why"_a = job.why, "next"_a = job.next,
                  "held_back"_a = job.held_back);
}

py::dict to_python(const api::Server& server) {
  return py::dict("id"_a = server.id, "version"_a = server.version, "state"_a = server.state,
                  "cells"_a = server.cells, "trouble"_a = server.trouble,
                  "uptime_s"_a = server.uptime_s, "queued_jobs"_a = server.queued_jobs);
}

py::dict to_python(const api::StoredBatch& batch) {
  return py::dict("cell"_a = batch.cell, "id"_a = batch.id, "kept_out"_a = batch.kept_out,
                  "hash"_a = batch.hash, "server"_a = batch.server, "poses"_a = batch.poses,
                  "accepted_unix_s"_a = batch.accepted_unix_s, "learned"_a = batch.learned);
}

py::dict to_python(const std::vector<api::Residual>& items) {
  using R = api::Residual;
  return py::dict("pose_id"_a = texts(items, [](const R& r) { return r.pose_id; }),
                  "nominal_mm"_a = figure_of(items, &R::nominal_mm),
                  "calibrated_mm"_a = figure_of(items, &R::calibrated_mm),
                  "compensated_mm"_a = figure_of(items, &R::compensated_mm),
                  "stddev_mm"_a = figure_of(items, &R::stddev_mm),
                  "in_domain"_a = figure_of(items, &R::in_domain));
}

template <typename T>
py::list list_of(const std::vector<T>& items) {
  return texts(items, [](const T& item) { return to_python(item); });
}

/// Joint vectors of a robot whose number of joints another place checks: the last axis.
std::vector<double> joints_of(const Numbers& array, const std::string& argument) {
  if (array.ndim() != 1 && array.ndim() != 2)
    refuse(argument, "an array of shape (N, n) is needed, n the robot's joints");
  return {array.data(), array.data() + array.size()};
}

/// The argument as (N, n) of a robot with n joints.
std::vector<double> joints_of(const Numbers& array, const std::string& argument,
                              std::size_t joints) {
  return rows_of(array, argument, static_cast<py::ssize_t>(joints));
}

/// Targets from columns: poses (N, 7), joints (N, n), branches (N,) or one for all.
std::vector<api::Target> targets_of(const std::optional<Numbers>& pose,
                                    const std::optional<Numbers>& joints_deg,
                                    const std::optional<Whole>& conf) {
  if (!pose && !joints_deg) refuse("pose", "poses or joints_deg are needed");
  const std::vector<double> wanted = pose ? rows_of(*pose, "pose", 7) : std::vector<double>();
  const std::vector<double> joints =
      joints_deg ? joints_of(*joints_deg, "joints_deg") : std::vector<double>();
  const auto rows_in = [](const Numbers& array) {
    return array.ndim() == 2 ? static_cast<std::size_t>(array.shape(0)) : 1;
  };
  const std::size_t count = pose ? wanted.size() / 7 : rows_in(*joints_deg);
  if (joints_deg && rows_in(*joints_deg) != count)
    refuse("joints_deg", "as many rows as poses are needed");
  const bool one_conf = conf && conf->size() == 1;
  if (conf && !one_conf && static_cast<std::size_t>(conf->size()) != count)
    refuse("conf", "one for all or one a pose is needed");
  const std::size_t n = count == 0 ? 0 : joints.size() / count;
  std::vector<api::Target> targets(count);
  for (std::size_t i = 0; i < count; ++i) {
    api::Target& target = targets[i];
    if (pose) {
      const double* p = &wanted[7 * i];
      target.pose = api::Pose{{p[0], p[1], p[2]}, {p[3], p[4], p[5], p[6]}};
    }
    target.joints_deg.assign(joints.begin() + static_cast<std::ptrdiff_t>(n * i),
                             joints.begin() + static_cast<std::ptrdiff_t>(n * (i + 1)));
    if (conf) target.conf = conf->data()[one_conf ? 0 : i];
  }
  return targets;
}

std::size_t joints_in(const std::vector<api::CorrectedTarget>& items) {
  std::size_t joints = 0;
  for (const auto& item : items) joints = std::max(joints, item.joints_deg.size());
  return joints;
}

api::Context context_of(std::string tool, std::string payload, std::vector<int> directions,
                        std::optional<double> temperature_c) {
  return {std::move(tool), std::move(payload), std::move(directions), temperature_c};
}

/// A pose alone, as a row of an array.
struct At {
  api::Pose pose;
};

void add_files(py::module_& m) {
  py::class_<api::Cell>(m, "Cell")
      .def_static(
          "load",
          [](const std::string& path) {
            return value_or_raise(unlocked([&] { return api::Cell::load(path); }));
          },
          "path"_a)
      .def("name", &api::Cell::name)
      .def("robot", &api::Cell::robot)
      .def("joints", &api::Cell::joints)
      .def("joint_columns", &api::Cell::joint_columns)
      .def("tools", &api::Cell::tools)
      .def("payloads", &api::Cell::payloads)
      .def(
          "tool_poses",
          [](const api::Cell& cell, const Numbers& joints_deg, const std::string& tool) {
            const std::vector<double> joints = joints_of(joints_deg, "joints_deg", cell.joints());
            const auto poses =
                value_or_raise(unlocked([&] { return cell.tool_poses(joints, tool); }));
            std::vector<At> at;
            for (const api::Pose& pose : poses) at.push_back({pose});
            return figure_of(at, &At::pose);
          },
          "joints_deg"_a, "tool"_a);
  py::class_<api::Batch>(m, "Batch")
      .def_static(
          "load",
          [](const std::string& path) {
            return value_or_raise(unlocked([&] { return api::Batch::load(path); }));
          },
          "path"_a)
      .def_static(
          "parse",
          [](const std::string& csv, const std::string& name) {
            return value_or_raise(unlocked([&] { return api::Batch::parse(csv, name); }));
          },
          "csv"_a, "name"_a)
      .def("name", &api::Batch::name)
      .def("size", &api::Batch::size)
      .def("csv", &api::Batch::csv)
      .def("table", &api::Batch::table);
}

py::list parameters_of(const api::Model& model) {
  return texts(model.parameters(), [](const api::Parameter& p) {
    return py::dict("name"_a = p.name, "unit"_a = p.unit, "value"_a = p.value, "u95"_a = p.u95,
                    "identified"_a = p.identified);
  });
}

/// The keys of `measured` in `trammel train --json`.
py::dict measured_of(const api::Model& model) {
  const api::Measured m = model.measured();
  py::dict out("sentence"_a = m.sentence);
  if (m.poses == 0) return out;
  py::list sides;
  for (std::size_t j = 0; j < m.from_above.size(); ++j)
    sides.append(py::dict("from_above"_a = m.from_above[j], "from_below"_a = m.from_below[j]));
  out["poses"] = m.poses;
  out["sides"] = sides;
  out["temperature_c"] = py::none();
  if (m.temperature_min_c)
    out["temperature_c"] = py::dict("min"_a = *m.temperature_min_c, "max"_a = *m.temperature_max_c);
  out["box_mm"] = py::dict("lower"_a = m.lower_mm, "upper"_a = m.upper_mm);
  out["volume_m3"] = m.volume_m3;
  out["reach_mm"] = m.reach_mm;
  out["instrument"] = m.instrument;
  return out;
}

py::array_t<double> covariance_of(const api::Model& model) {
  const std::vector<double> flat = model.parameter_covariance();
  const auto size = static_cast<py::ssize_t>(model.parameters().size());
  return py::array_t<double>({size, size}, flat.data());
}

void add_model_file(py::class_<api::Model>& type) {
  type.def_static(
          "load",
          [](const std::string& path) {
            return value_or_raise(unlocked([&] { return api::Model::load(path); }));
          },
          "path"_a)
      .def_static(
          "parse",
          [](const std::string& text, const std::string& where) {
            return value_or_raise(unlocked([&] { return api::Model::parse(text, where); }));
          },
          "text"_a, "where"_a)
      .def(
          "save",
          [](const api::Model& model, const std::string& path) {
            value_or_raise(unlocked([&] { return model.save(path); }));
          },
          "path"_a)
      .def("text", [](const api::Model& model) { return unlocked([&] { return model.text(); }); })
      .def("facts", [](const api::Model& model) { return to_python(model.facts()); })
      .def("cell", &api::Model::cell)
      .def("bias", &api::Model::bias)
      .def("parameters", &parameters_of)
      .def("parameter_covariance", &covariance_of)
      .def("figures", [](const api::Model& model) { return to_python(model.figures()); })
      .def("measured", &measured_of)
      .def("budget_json", &api::Model::budget_json)
      .def("notes", [](const api::Model& model) { return to_python(model.notes()); });
}

void add_model_work(py::class_<api::Model>& type) {
  type.def(
          "predict",
          [](const api::Model& model, const Numbers& joints_deg, std::string tool,
             std::string payload, std::vector<int> directions,
             std::optional<double> temperature_c) {
            const std::vector<double> joints =
                joints_of(joints_deg, "joints_deg", model.cell().joints());
            const api::Context context = context_of(std::move(tool), std::move(payload),
                                                    std::move(directions), temperature_c);
            return to_python(
                value_or_raise(unlocked([&] { return model.predict(joints, context); })));
          },
          "joints_deg"_a, "tool"_a, "payload"_a, "directions"_a, "temperature_c"_a)
      .def(
          "correct",
          [](const api::Model& model, const std::optional<Numbers>& pose,
             const std::optional<Numbers>& joints_deg, const std::optional<Whole>& conf,
             std::string tool, std::string payload, std::vector<int> directions,
             std::optional<double> temperature_c) {
            const std::vector<api::Target> targets = targets_of(pose, joints_deg, conf);
            const api::Context context = context_of(std::move(tool), std::move(payload),
                                                    std::move(directions), temperature_c);
            return to_python(
                value_or_raise(unlocked([&] { return model.correct(targets, context); })),
                model.cell().joints());
          },
          "pose"_a, "joints_deg"_a, "conf"_a, "tool"_a, "payload"_a, "directions"_a,
          "temperature_c"_a)
      .def(
          "evaluate",
          [](const api::Model& model, const std::vector<api::Batch>& batches) {
            return to_python(value_or_raise(unlocked([&] { return model.evaluate(batches); })));
          },
          "batches"_a);
}

void add_model_answers(py::class_<api::Model>& type) {
  type.def(
          "residuals",
          [](const api::Model& model, const std::vector<api::Batch>& batches) {
            return to_python(value_or_raise(unlocked([&] { return model.residuals(batches); })));
          },
          "batches"_a)
      .def(
          "check",
          [](const api::Model& model, const api::Batch& batch, std::optional<double> tolerance_mm,
             bool new_tool, std::vector<std::string> earlier) {
            const api::CheckOptions options{tolerance_mm, new_tool, std::move(earlier)};
            return value_or_raise(unlocked([&] { return model.check(batch, options); }));
          },
          "batch"_a, "tolerance_mm"_a, "new_tool"_a, "earlier"_a)
      .def(
          "report",
          [](const api::Model& model, const std::vector<api::Batch>& batches) {
            return value_or_raise(unlocked([&] { return model.report(batches); }));
          },
          "batches"_a)
      .def(
          "correct_program",
          [](const api::Model& model, const std::vector<std::pair<std::string, py::bytes>>& files,
             std::string format, std::string tool, std::string payload, bool keep_digits) {
            std::vector<api::ProgramFile> program;
            for (const auto& [name, text] : files) program.push_back({name, std::string(text)});
            const api::ProgramOptions options{std::move(format), std::move(tool),
                                              std::move(payload), keep_digits};
            const auto corrected =
                value_or_raise(unlocked([&] { return model.correct_program(program, options); }));
            py::list out;
            for (const api::ProgramFile& file : corrected.files)
              out.append(py::make_tuple(file.name, py::bytes(file.text)));
            return py::make_tuple(out, corrected.receipt_csv, corrected.receipt_json,
                                  corrected.all);
          },
          "files"_a, "format"_a, "tool"_a, "payload"_a, "keep_digits"_a);
}

void add_work(py::module_& m) {
  m.def(
      "train",
      [](const api::Cell& cell, const std::vector<api::Batch>& batches,
         std::optional<std::string> level, std::optional<std::string> bias, std::uint64_t seed,
         double validation_share, const py::object& progress, bool as_read,
         const std::vector<api::Model>& fleet) {
        return told_of(progress, [&](api::Progress told) {
          return api::train(cell, batches,
                            {std::move(level), std::move(bias), seed, validation_share,
                             std::move(told), as_read, fleet});
        });
      },
      "cell"_a, "batches"_a, "level"_a, "bias"_a, "seed"_a, "validation_share"_a, "progress"_a,
      "as_read"_a, "fleet"_a);
  m.def(
      "diagnose",
      [](const api::Cell& cell, const std::vector<api::Batch>& batches, std::uint64_t seed,
         const py::object& progress) {
        return told_of(progress, [&](api::Progress told) {
          return api::diagnose(cell, batches, {seed, std::move(told)});
        });
      },
      "cell"_a, "batches"_a, "seed"_a, "progress"_a);
  m.def(
      "extend",
      [](const api::Cell& cell, const std::vector<api::Batch>& batches, std::uint64_t seed,
         const py::object& progress) {
        const api::Extension found = told_of(progress, [&](api::Progress told) {
          return api::extend(cell, batches, {seed, std::move(told)});
        });
        return py::make_tuple(found.findings, found.model, found.error_sources, found.why_not);
      },
      "cell"_a, "batches"_a, "seed"_a, "progress"_a);
  m.def(
      "plan",
      [](const api::Cell& cell, std::size_t count, std::uint64_t seed, std::string criterion,
         bool positions_only) {
        const api::PlanOptions options{count, seed, std::move(criterion), positions_only};
        const api::Plan plan = value_or_raise(unlocked([&] { return api::plan(cell, options); }));
        const py::array_t<double> joints({static_cast<py::ssize_t>(plan.pose_ids.size()),
                                          static_cast<py::ssize_t>(cell.joints())},
                                         plan.joints_deg.data());
        return py::dict("pose_ids"_a = plan.pose_ids, "joints_deg"_a = joints, "csv"_a = plan.csv);
      },
      "cell"_a, "count"_a, "seed"_a, "criterion"_a, "positions_only"_a);
  m.def(
      "simulate",
      [](const api::Cell& cell, const std::string& truth, const std::string& plan_csv,
         std::uint64_t seed, bool positions_only, bool noise_free) {
        return value_or_raise(unlocked([&] {
          return api::simulate(cell, truth, plan_csv, {seed, positions_only, noise_free});
        }));
      },
      "cell"_a, "truth"_a, "plan_csv"_a, "seed"_a, "positions_only"_a, "noise_free"_a);
}

std::chrono::milliseconds milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(1000 * seconds));
}

using api::Session;

/// Session::wait_for() in slices, so that Ctrl-C ends it at once.
api::Job waited_for(const Session& session, std::int64_t job, std::chrono::milliseconds limit) {
  constexpr std::chrono::milliseconds kSlice{200};
  const auto until = std::chrono::steady_clock::now() + limit;
  bool was_there = false;  // from then on a server that does not answer is waited for
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        until - std::chrono::steady_clock::now());
    auto ended = unlocked([&] {
      return session.wait_for(job, std::clamp(left, std::chrono::milliseconds(0), kSlice),
                              [&](const api::Job&) { was_there = true; });
    });
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    const bool goes_on =
        !ended && ended.error().code == api::ErrorCode::kUnreachable && was_there && left > kSlice;
    if (!goes_on) return value_or_raise(std::move(ended));
  }
}

void add_session_state(py::class_<Session>& session) {
  session
      .def_static(
          "open",
          [](std::uint32_t domain, std::vector<std::uint16_t> ports, double timeout_s,
             std::vector<std::string> hosts, std::string security,
             std::vector<std::string> discovery_servers) {
            const api::SessionOptions options{
                domain,           std::move(ports),    milliseconds(timeout_s),
                std::move(hosts), std::move(security), std::move(discovery_servers)};
            return value_or_raise(unlocked([&] { return Session::open(options); }));
          },
          "domain"_a, "ports"_a, "timeout_s"_a, "hosts"_a, "security"_a, "discovery_servers"_a)
      .def("servers",
           [](const Session& s) {
             return list_of(value_or_raise(unlocked([&] { return s.servers(); })));
           })
      .def(
          "batches",
          [](const Session& s, const std::string& cell) {
            return list_of(value_or_raise(unlocked([&] { return s.batches(cell); })));
          },
          "cell"_a)
      .def(
          "export_batch",
          [](const Session& s, const std::string& cell, const std::string& batch_id) {
            return value_or_raise(unlocked([&] { return s.export_batch(cell, batch_id); }));
          },
          "cell"_a, "batch_id"_a)
      .def(
          "audit",
          [](const Session& s, const std::string& cell, std::int64_t since, std::size_t most) {
            return value_or_raise(unlocked([&] { return s.audit(cell, since, most); }));
          },
          "cell"_a, "since_unix_s"_a, "most"_a)
      .def(
          "cancel",
          [](const Session& s, std::int64_t job) {
            value_or_raise(unlocked([&] { return s.cancel(job); }));
          },
          "job"_a)
      .def(
          "models",
          [](const Session& s, const std::string& cell) {
            return list_of(value_or_raise(unlocked([&] { return s.models(cell); })));
          },
          "cell"_a)
      .def(
          "export_model",
          [](const Session& s, const std::string& cell, int version) {
            return value_or_raise(unlocked([&] { return s.export_model(cell, version); }));
          },
          "cell"_a, "version"_a);
}

void add_session_work(py::class_<Session>& session) {
  session
      .def(
          "predict",
          [](const Session& s, const std::string& cell, const Numbers& joints_deg, std::string tool,
             std::string payload, std::vector<int> directions,
             std::optional<double> temperature_c) {
            const std::vector<double> joints = joints_of(joints_deg, "joints_deg");
            const api::Asked asked{cell,
                                   context_of(std::move(tool), std::move(payload),
                                              std::move(directions), temperature_c),
                                   false};
            const auto answer = value_or_raise(unlocked([&] { return s.predict(asked, joints); }));
            if (answer.items.size() !=
                static_cast<std::size_t>(joints_deg.ndim() == 2 ? joints_deg.shape(0) : 1))
              refuse("joints_deg", "an array of shape (N, n) is needed, n the robot's joints");
            return py::make_tuple(to_python(answer.model), to_python(answer.items));
          },
          "cell"_a, "joints_deg"_a, "tool"_a, "payload"_a, "directions"_a, "temperature_c"_a)
      .def(
          "correct",
          [](const Session& s, const std::string& cell, const std::optional<Numbers>& pose,
             const std::optional<Numbers>& joints_deg, const std::optional<Whole>& conf,
             std::string tool, std::string payload, std::vector<int> directions,
             std::optional<double> temperature_c) {
            const std::vector<api::Target> targets = targets_of(pose, joints_deg, conf);
            const api::Asked asked{cell,
                                   context_of(std::move(tool), std::move(payload),
                                              std::move(directions), temperature_c),
                                   false};
            const auto answer = value_or_raise(unlocked([&] { return s.correct(asked, targets); }));
            return py::make_tuple(to_python(answer.model),
                                  to_python(answer.items, joints_in(answer.items)));
          },
          "cell"_a, "pose"_a, "joints_deg"_a, "conf"_a, "tool"_a, "payload"_a, "directions"_a,
          "temperature_c"_a);
}

void add_session_care(py::class_<Session>& session) {
  session
      .def(
          "retrain",
          [](const Session& s, const std::string& cell, const std::vector<std::string>& batch_ids,
             const std::string& level, const std::string& bias) {
            return value_or_raise(
                unlocked([&] { return s.retrain(cell, batch_ids, level, bias); }));
          },
          "cell"_a, "batch_ids"_a, "level"_a, "bias"_a)
      .def(
          "diagnose",
          [](const Session& s, const std::string& cell, const std::string& batch_id,
             const std::string& csv, bool apply) {
            return value_or_raise(unlocked([&] { return s.diagnose(cell, batch_id, csv, apply); }));
          },
          "cell"_a, "batch_id"_a, "csv"_a, "apply"_a)
      .def(
          "check",
          [](const Session& s, const std::string& cell, const std::string& batch_id,
             const std::string& csv, std::optional<double> tolerance_mm) {
            return value_or_raise(
                unlocked([&] { return s.check(cell, batch_id, csv, tolerance_mm); }));
          },
          "cell"_a, "batch_id"_a, "csv"_a, "tolerance_mm"_a)
      .def(
          "findings",
          [](const Session& s, const std::string& cell, std::int64_t job) {
            return value_or_raise(unlocked([&] { return s.findings(cell, job); }));
          },
          "cell"_a, "job"_a)
      .def(
          "import_model",
          [](const Session& s, const std::string& cell, const std::string& text) {
            return value_or_raise(unlocked([&] { return s.import_model(cell, text); }));
          },
          "cell"_a, "text"_a);
}

void add_session_changes(py::class_<Session>& session) {
  session
      .def(
          "submit",
          [](const Session& s, const std::string& cell, const std::string& batch_id,
             const std::string& csv) {
            return value_or_raise(unlocked([&] { return s.submit(cell, batch_id, csv); }));
          },
          "cell"_a, "batch_id"_a, "csv"_a)
      .def(
          "wait_for",
          [](const Session& s, std::int64_t job, double limit_s) {
            return to_python(waited_for(s, job, milliseconds(limit_s)));
          },
          "job"_a, "limit_s"_a)
      .def(
          "jobs",
          [](const Session& s, const std::string& cell) {
            return list_of(value_or_raise(unlocked([&] { return s.jobs(cell); })));
          },
          "cell"_a)
      .def(
          "activate",
          [](const Session& s, const std::string& cell, int version, const std::string& reason,
             std::optional<int> expected_version, bool force) {
            return value_or_raise(unlocked(
                [&] { return s.activate(cell, version, reason, expected_version, force); }));
          },
          "cell"_a, "version"_a, "reason"_a, "expected_version"_a, "force"_a)
      .def(
          "roll_back",
          [](const Session& s, const std::string& cell, const std::string& reason,
             std::optional<int> expected_version) {
            return value_or_raise(
                unlocked([&] { return s.roll_back(cell, reason, expected_version); }));
          },
          "cell"_a, "reason"_a, "expected_version"_a)
      .def(
          "release",
          [](const Session& s, const std::string& cell, const std::string& batch_id,
             const std::string& reason, std::optional<int> expected_version) {
            value_or_raise(
                unlocked([&] { return s.release(cell, batch_id, reason, expected_version); }));
          },
          "cell"_a, "batch_id"_a, "reason"_a, "expected_version"_a)
      .def(
          "discard",
          [](const Session& s, const std::string& cell, const std::string& batch_id,
             const std::string& reason, std::optional<int> expected_version) {
            value_or_raise(
                unlocked([&] { return s.discard(cell, batch_id, reason, expected_version); }));
          },
          "cell"_a, "batch_id"_a, "reason"_a, "expected_version"_a);
}

}  // namespace

PYBIND11_MODULE(_trammel, m) {
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Failed& failed) {
      raise(failed.error);
    }
  });
  add_files(m);
  py::class_<api::Model> model(m, "Model");
  add_model_file(model);
  add_model_work(model);
  add_model_answers(model);
  add_work(m);
  m.def(
      "history",
      [](const std::vector<api::Model>& models) {
        return value_or_raise(unlocked([&] { return api::history(models); }));
      },
      "models"_a);
  m.attr("version") = TRAMMEL_VERSION;
  py::class_<Session> session(m, "Session");
  add_session_state(session);
  add_session_work(session);
  add_session_changes(session);
  add_session_care(session);
}

}  // namespace trammel::python
