#include "server/bias/kernels/linear_block.h"

#include "server/base/check.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearBlocks::LinearBlocks(std::vector<LinearBlockPtr> blocks, const BiasFeatures& shape)
    : blocks_(std::move(blocks)), shape_(shape) {
  for (const LinearBlockPtr& block : blocks_) {
    columns_ += block->column_count(shape_);
    parameters_ += block->parameter_count(shape_);
  }
}

VectorXd LinearBlocks::of_each(VectorXd (LinearBlock::*figure)(const BiasFeatures&) const) const {
  VectorXd all(parameters_);
  Index first = 0;
  for (const LinearBlockPtr& block : blocks_) {
    const VectorXd part = ((*block).*figure)(shape_);
    all.segment(first, part.size()) = part;
    first += part.size();
  }
  return all;
}

MatrixXd LinearBlocks::columns(const JointVector& q, const BiasFeatures& features) const {
  MatrixXd all(6, columns_);
  Index first = 0;
  for (const LinearBlockPtr& block : blocks_) {
    const Index count = block->column_count(shape_);
    block->columns(q, features, all.middleCols(first, count));
    first += count;
  }
  return all;
}

void LinearBlocks::log_variance(const VectorXd& parameters, VectorXd* log_variance,
                                MatrixXd* derivative) const {
  TRAMMEL_CHECK(parameters.size() == parameters_);
  log_variance->setZero(columns_);
  derivative->setZero(columns_, parameters_);
  Index column = 0;
  Index parameter = 0;
  for (const LinearBlockPtr& block : blocks_) {
    const Index columns = block->column_count(shape_);
    const Index count = block->parameter_count(shape_);
    block->log_variance(shape_, parameters.segment(parameter, count),
                        log_variance->segment(column, columns),
                        derivative->block(column, parameter, columns, count));
    column += columns;
    parameter += count;
  }
}

}  // namespace trammel
