#pragma once

#include <httplib.h>

// <resolv.h>, which comes with it, makes this a macro; Eigen has parameters of the name.
#undef _res
