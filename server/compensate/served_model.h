#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/base/note.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// A model with its place in the cell's history.
struct ServedModel {
  ServedModel(std::string cell, int version, CompensatedModel model);

  std::string cell;
  int version = 0;
  CompensatedModel model;
  std::vector<Note> notes;  ///< notes_of(model): each answer carries them
};

using ServedModelPtr = std::shared_ptr<const ServedModel>;

}  // namespace trammel
