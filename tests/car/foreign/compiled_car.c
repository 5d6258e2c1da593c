/* The car of examples/simulators/fmu_car.py in C, as an FMU 2.0 for model exchange (-DFMI=2) or an FMU 3.0 for both
   (-DFMI=3): the functions that an importer needs. Value references count from 0 in the order of `enum`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if FMI == 2
#include "fmi2Functions.h"
#define N(name) fmi2##name
#else
#include "fmi3Functions.h"
#define N(name) fmi3##name
#endif

enum { M, J, LF, LR, MU, CF, CR, JW, RADIUS, VX0, VY0, R0, W0, STEER, TORQUE, FX, FY, MZ,
       VX, VY, R, W, PSI, D_VX, D_VY, D_R, D_W, D_PSI, COUNT };
#define STATES 5
static const double begin[COUNT] = {1450, 2200, 1.2, 1.3, 1, 1.2e5, 1.5e5, 12, 0.32, 12, 0, 0, 37.5};

static void rates(double *z) {
  double base = z[LF] + z[LR], weight = z[M] * 9.81, roll = fmax(z[VX], 1);
  double front = z[MU] * weight * z[LR] / base, rear = z[MU] * weight * z[LF] / base;
  double f = -front * tanh(z[CF] * (atan2(z[VY] + z[LF] * z[R], roll) - z[STEER]) / front);
  double sy = -atan2(z[VY] - z[LR] * z[R], roll), sx = (z[W] * z[RADIUS] - z[VX]) / roll;
  double slip = hypot(sx, sy) + 1e-9, force = rear * tanh(z[CR] * slip / rear);
  double fx = force * sx / slip, fy = force * sy / slip;
  z[D_VX] = (fx - f * sin(z[STEER]) + z[FX]) / z[M] + z[R] * z[VY];
  z[D_VY] = (fy + f * cos(z[STEER]) + z[FY]) / z[M] - z[R] * z[VX];
  z[D_R] = (z[LF] * f * cos(z[STEER]) - z[LR] * fy + z[MZ]) / z[J];
  z[D_W] = (z[TORQUE] - fx * z[RADIUS]) / z[JW];
  z[D_PSI] = z[R];
}

static void advance(double *z, double h) { /* the midpoint rule */
  double at[STATES];
  rates(z);
  memcpy(at, z + VX, sizeof at);
  for (int i = 0; i < STATES; i++) z[VX + i] = at[i] + 0.5 * h * z[D_VX + i];
  rates(z);
  for (int i = 0; i < STATES; i++) z[VX + i] = at[i] + h * z[D_VX + i];
}

static void settle(double *z) {
  memcpy(z + VX, z + VX0, 4 * sizeof *z);
  z[PSI] = 0;
}

static void *made(void) {
  double *z = malloc(sizeof begin);
  memcpy(z, begin, sizeof begin);
  return z;
}

static void read_states(double *z, double *x) { memcpy(x, z + VX, STATES * sizeof *x); }
static void read_derivatives(double *z, double *x) { rates(z); memcpy(x, z + D_VX, STATES * sizeof *x); }
static void write_states(double *z, const double *x) { memcpy(z + VX, x, STATES * sizeof *x); }

#if FMI == 2
#define OK fmi2OK
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String where,
                              const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
  return made();
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean given, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stops, fmi2Real stop) { return OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference of[], size_t n, const fmi2Real value[]) {
  for (size_t i = 0; i < n; i++) ((double *)c)[of[i]] = value[i];
  return OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference of[], size_t n, fmi2Real value[]) {
  for (size_t i = 0; i < n; i++) value[i] = ((double *)c)[of[i]];
  return OK;
}
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
  memset(info, 0, sizeof *info);
  return OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean kept, fmi2Boolean *event, fmi2Boolean *ends) {
  *event = *ends = 0;
  return OK;
}
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { read_derivatives(c, x); return OK; }
#else
#define OK fmi3OK
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment self,
                                          fmi3LogMessageCallback log) { return made(); }
fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String where, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference between[], size_t n, fmi3InstanceEnvironment self,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  return made();
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean given, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean stops, fmi3Float64 stop) { return OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference of[], size_t n, const fmi3Float64 value[],
                          size_t count) {
  for (size_t i = 0; i < n; i++) ((double *)c)[of[i]] = value[i];
  return OK;
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference of[], size_t n, fmi3Float64 value[], size_t count) {
  for (size_t i = 0; i < n; i++) value[i] = of[i] == COUNT ? 0 : ((double *)c)[of[i]];
  return OK;
}
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *timed, fmi3Float64 *next) {
  *again = *ends = *nominals = *values = *timed = 0;
  return OK;
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean kept, fmi3Boolean *event, fmi3Boolean *ends) {
  *event = *ends = 0;
  return OK;
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) {
  read_derivatives(c, x);
  return OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 at, fmi3Float64 step, fmi3Boolean final, fmi3Boolean *event,
                      fmi3Boolean *ends, fmi3Boolean *early, fmi3Float64 *last) {
  int count = fmax(round(step / 0.001), 1);
  for (int i = 0; i < count; i++) advance(c, step / count);
  *event = *ends = *early = 0;
  *last = at + step;
  return OK;
}
#endif
#define STATUS(name) N(Status) N(name)
typedef double real;
STATUS(ExitInitializationMode)(void *c) { settle(c); return OK; }
#ifdef NO_RESET /* as of some exporters: an error */
STATUS(Reset)(void *c) { return (N(Status))3; }
#else
STATUS(Reset)(void *c) { memcpy(c, begin, sizeof begin); return OK; }
#endif
STATUS(Terminate)(void *c) { return OK; }
STATUS(EnterContinuousTimeMode)(void *c) { return OK; }
STATUS(SetTime)(void *c, real time) { return OK; }
STATUS(GetContinuousStates)(void *c, real x[], size_t n) { read_states(c, x); return OK; }
STATUS(SetContinuousStates)(void *c, const real x[], size_t n) { write_states(c, x); return OK; }
STATUS(GetNominalsOfContinuousStates)(void *c, real x[], size_t n) {
  for (size_t i = 0; i < n; i++) x[i] = 1;
  return OK;
}
STATUS(GetEventIndicators)(void *c, real x[], size_t n) { return OK; }
void N(FreeInstance)(void *c) { free(c); }
