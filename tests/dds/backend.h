#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "server/base/units.h"
#include "server/dds/dds_options.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/trainer.h"
#include "tests/support/own_ports.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

/// A model of a robot whose base stands `shift` (m) off along x: it predicts that error everywhere.
inline CompensatedModel shifted_model(const std::shared_ptr<const Cell>& cell, double shift) {
  auto physics = make_physical_model(cell, {"base"});
  if (!physics) throw std::runtime_error(physics.error().message);
  const auto parameters = physics->parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].name == "x0") physics->values[static_cast<Eigen::Index>(i)] = shift;
  }
  CompensatedModel::Parts parts;
  parts.physics = std::move(*physics);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    IdentifiedParameter identified;
    identified.parameter = parameters[i];
    identified.value = parts.physics.values[static_cast<Eigen::Index>(i)];
    parts.parameters.push_back(identified);
  }
  parts.covariance =
      Eigen::MatrixXd::Zero(parts.physics.values.size(), parts.physics.values.size());
  parts.q_min = JointVector::Constant(cell->robot.size(), from_deg(-60));
  parts.q_max = JointVector::Constant(cell->robot.size(), from_deg(60));
  parts.trained_with = {{"spindle", cell->payloads.empty() ? "" : cell->payloads.begin()->first}};
  parts.provenance.level = "base";
  parts.provenance.batch_id = fmt::format("shift-{}", shift);
  parts.provenance.training_poses = 40;
  auto model = CompensatedModel::make(std::move(parts));
  if (!model) throw std::runtime_error(model.error().message);
  return *model;
}

/// Everything behind the handlers, for the small cell `cell-7`.
struct Backend {
  explicit Backend(const TrainerOptions& options = {}) {
    auto opened = Store::open(folder.file("trammel.db"));
    if (!opened) throw std::runtime_error(opened.error().message);
    store = std::move(*opened);
    trainer = std::make_unique<Trainer>(
        std::map<std::string, std::shared_ptr<const Cell>>{{"cell-7", cell},
                                                           {"cell-8", small_cell("cell-8")}},
        *store, registry, options);
  }

  /// Puts a model that predicts `version` tenths of a millimetre in force, in memory only.
  std::shared_ptr<const ServedModel> serve(int version) {
    auto served = std::make_shared<const ServedModel>(
        ServedModel{"cell-7", version, shifted_model(cell, version * 1e-4)});
    registry.publish(served);
    return served;
  }

  TemporaryFolder folder;
  std::shared_ptr<const Cell> cell = small_cell("cell-7");
  std::unique_ptr<Store> store;
  ModelRegistry registry;
  std::unique_ptr<Trainer> trainer;
};

/// A domain and a port of this test's own.
inline DdsOptions test_dds_options() {
  static int count = 0;
  DdsOptions options;
  options.domain = own_domain();
  options.port = static_cast<std::uint16_t>(own_ports() + 4 * (count++ % 2));
  options.server_id = "server-a";
  return options;
}

}  // namespace trammel::test
