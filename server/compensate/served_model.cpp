#include "server/compensate/served_model.h"

#include <utility>

#include "server/compensate/model_notes.h"

namespace trammel {

ServedModel::ServedModel(std::string of_cell, int of_version, CompensatedModel served)
    : cell(std::move(of_cell)),
      version(of_version),
      model(std::move(served)),
      notes(notes_of(model)) {}

}  // namespace trammel
