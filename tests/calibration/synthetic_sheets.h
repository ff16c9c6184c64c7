#pragma once

#include "pipelines/calibrate/synthetic_sheets.h"

namespace sateen::testing {

using sateen::SamplesOf;
using sateen::SamplesOn;
using sateen::SheetNormals;
using sateen::SyntheticCamera;

}  // namespace sateen::testing
