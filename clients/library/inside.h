#pragma once

#include <memory>
#include <string>

#include "clients/library/trammel/offline.h"
#include "server/compensate/compensated_model.h"
#include "server/measurement/measurement.h"
#include "server/robot/cell.h"
#include "server/tasks/train/told_by_training.h"

/// The parts that the values of the library are made of.
namespace trammel::api {

struct Cell::Inside {
  std::shared_ptr<const trammel::Cell> cell;
  std::string where;  ///< names its file in errors
};

struct Batch::Inside {
  MeasurementBatch rows;
};

struct Model::Inside {
  CompensatedModel model;
  ToldByTraining told = {};  ///< for a model trained here; a file only has the model's own notes
};

}  // namespace trammel::api
