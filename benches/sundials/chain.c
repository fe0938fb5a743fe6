/* The servo system once more, integrated by SUNDIALS CVODE (BDF, dense direct solver): the yardstick of `benches/chain`.
 *
 * chain TAPE OUT CLOSED RESTART ORDER RTOL ATOL REPEATS
 *
 * TAPE: per process the number of rows, the 9 initial states, then command, ESV, tank pressure and measured servomotor position
 * every 10 ms, all float64. OUT: spool and servomotor position in pu at every row. CLOSED 1: the regulator reads the simulated
 * servomotor; 0: the measured one. RESTART 1: a fresh start at every change of the valve's current, which is every
 * millisecond; 0: CVODE keeps its history and stops there only (it starts afresh after a blow on a stop and at an ESV edge).
 * ATOL counts in units of each state's typical size. Prints the least processor seconds of all repeats, steps, evaluations.
 *
 * Equations and numbers are the reference unit's, after Liu et al. 2025 and Merritt 1967, written apart from the Rust ones.
 */
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <time.h>

enum { XP, VP, P, X, V, P1, P2, Z, W, STATES };

static const double BETA = 1.0e9, P_T = 0.1e6, RHO = 870.0, CORE_PA = 1.0e4, CORE_M_S = 2.0e-4, VACUUM = -101325.0;
static const double OMEGA = 377.0, ZETA = 0.75, Q_N = 6.67e-4, DP_N = 3.5e6;
static const double CD = 0.62, A_E = 2.0e-5;
static const double M = 25.0, B = 1500.0, A_CTRL = 5.0e-3, A_CONS = 2.5e-3, K_F = 4.0e4, D_0 = 0.030, C_L = 2.0e-13, V_0 = 5.0e-4;
static const double STROKE_Y = 0.015, X_MIN = -0.015, X_MAX = 0.012, G = 9.81;
static const double WIDTH = 0.030, H_0 = 2.0e-4;
static const double A_O = 0.20, A_C = 0.18, S = 0.60, V_D = 0.02, M_S = 8000.0, B_S = 4.0e5, F_C = 4.0e4, F_0 = 1.5e5, F_1 = 2.5e5;
static const double TYPICAL[STATES] = {1.0, 400.0, 1e6, 0.015, 0.1, 1e6, 1e6, 0.6, 0.1};

typedef struct {
    double u, open, p_s;
    long evaluations;
} Drive;

static double clamp(double v, double lo, double hi) { return v < lo ? lo : v > hi ? hi : v; }

/* Root of a pressure drop with its sign; an odd cubic below 10 kPa. */
static double root(double dp) {
    double size = fabs(dp);
    if (size >= CORE_PA) return copysign(sqrt(size), dp);
    double s = dp / CORE_PA;
    return 100.0 * s * (1.25 - 0.25 * s * s);
}

static double inward(double rate, double at, double lo, double hi) {
    return (at <= lo && rate < 0.0) || (at >= hi && rate > 0.0) ? 0.0 : rate;
}

static int rates(sunrealtype t, N_Vector state, N_Vector rate, void *user) {
    (void)t;
    Drive *d = user;
    d->evaluations++;
    const double *y = N_VGetArrayPointer(state);
    double *f = N_VGetArrayPointer(rate);
    double x = clamp(y[X], X_MIN, X_MAX), v = inward(y[V], y[X], X_MIN, X_MAX);
    double z = clamp(y[Z], 0.0, S), w = inward(y[W], y[Z], 0.0, S);
    double p = y[P], p_1 = y[P1], p_2 = y[P2], p_s = d->p_s;

    f[XP] = inward(y[VP], y[XP], -1.0, 1.0);
    f[VP] = inward(OMEGA * OMEGA * (d->u - y[XP]) - 2.0 * ZETA * OMEGA * y[VP], y[XP], -1.0, 1.0);

    double q = 0.0;
    if (d->open >= 1.0) {
        double x_p = clamp(y[XP], -1.0, 1.0);
        q = Q_N / sqrt(DP_N) * x_p * (x_p >= 0.0 ? root(p_s - p) : root(p - P_T));
    } else {
        q = -CD * A_E * sqrt(2.0 / RHO) * root(p - P_T);
    }
    f[P] = (q + C_L * (p_s - p) - A_CTRL * v) * BETA / (V_0 + A_CTRL * x);
    f[X] = v;
    double spring = x > -D_0 ? K_F * (D_0 + x) : 0.0;
    f[V] = inward((p * A_CTRL - p_s * A_CONS + M * G - spring - B * v) / M, y[X], X_MIN, X_MAX);

    double x_eff = x > H_0 ? x - H_0 : x < -H_0 ? x + H_0 : 0.0;
    double c = CD * WIDTH * x_eff * sqrt(2.0 / RHO), q_1, q_2;
    if (x_eff >= 0.0) {
        q_1 = c * root(p_s - p_1);
        q_2 = c * root(p_2 - P_T);
    } else {
        q_1 = c * root(p_1 - P_T);
        q_2 = c * root(p_s - p_2);
    }
    f[P1] = BETA / (V_D + A_O * z) * (q_1 - A_O * w);
    f[P2] = BETA / (V_D + A_C * (S - z)) * (A_C * w - q_2);
    f[Z] = w;
    double friction = F_C * clamp(w / CORE_M_S, -1.0, 1.0) + B_S * w;
    f[W] = inward((p_1 * A_O - p_2 * A_C - (F_0 + F_1 * z / S) - friction) / M_S, y[Z], 0.0, S);
    return 0;
}

/* The Jacobian by one-sided differences. A body at a stop is moved into it: away from a stop the rates jump. */
static int jacobian(sunrealtype t, N_Vector state, N_Vector rate, SUNMatrix matrix, void *user, N_Vector moved, N_Vector moved_rate, N_Vector spare) {
    (void)spare;
    const double *y = N_VGetArrayPointer(state), *f = N_VGetArrayPointer(rate), *g = N_VGetArrayPointer(moved_rate);
    double pilot = y[XP] >= 1.0 ? 1.0 : -1.0, spool = y[X] >= X_MAX ? 1.0 : -1.0, piston = y[Z] >= S ? 1.0 : -1.0;
    const double side[STATES] = {pilot, pilot, 1.0, spool, spool, 1.0, 1.0, piston, piston};
    for (int j = 0; j < STATES; j++) {
        double delta = 1e-7 * side[j] * TYPICAL[j], *column = SUNDenseMatrix_Column(matrix, j);
        N_VScale(1.0, state, moved);
        N_VGetArrayPointer(moved)[j] += delta;
        rates(t, moved, moved_rate, user);
        for (int i = 0; i < STATES; i++) column[i] = (g[i] - f[i]) / delta;
    }
    return 0;
}

static int hold(double *at, double *speed, double lo, double hi) {
    double before = *at, moving = *speed;
    if (*at <= lo) {
        *at = lo;
        *speed = fmax(*speed, 0.0);
    } else if (*at >= hi) {
        *at = hi;
        *speed = fmin(*speed, 0.0);
    }
    return *at != before || *speed != moving;
}

/* Back inside the stops; says whether anything moved. */
static int confine(double *y) {
    int moved = hold(&y[XP], &y[VP], -1.0, 1.0) | hold(&y[X], &y[V], X_MIN, X_MAX) | hold(&y[Z], &y[W], 0.0, S);
    for (int i = 0; i < 3; i++) {
        double *p = &y[(int[]){P, P1, P2}[i]];
        if (*p < VACUUM) {
            *p = VACUUM;
            moved = 1;
        }
    }
    return moved;
}

static void check(int flag, const char *what) {
    if (flag < 0) {
        fprintf(stderr, "chain: %s failed with %d\n", what, flag);
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc != 9) {
        fprintf(stderr, "chain TAPE OUT CLOSED RESTART ORDER RTOL ATOL REPEATS\n");
        return 2;
    }
    int closed = atoi(argv[3]), restart = atoi(argv[4]), order = atoi(argv[5]), repeats = atoi(argv[8]);
    double rtol = atof(argv[6]), atol = atof(argv[7]);
    FILE *in = fopen(argv[1], "rb");
    if (!in) return perror(argv[1]), 1;
    fseek(in, 0, SEEK_END);
    size_t count = (size_t)ftell(in) / sizeof(double);
    rewind(in);
    double *tape = malloc(count * sizeof(double)), *out = malloc(count * sizeof(double));
    if (!tape || !out || fread(tape, sizeof(double), count, in) != count) return perror(argv[1]), 1;
    fclose(in);

    SUNContext context;
    check(SUNContext_Create(NULL, &context), "SUNContext_Create");
    N_Vector state = N_VNew_Serial(STATES, context), tolerance = N_VNew_Serial(STATES, context);
    SUNMatrix matrix = SUNDenseMatrix(STATES, STATES, context);
    SUNLinearSolver linear = SUNLinSol_Dense(state, matrix, context);
    double *y = N_VGetArrayPointer(state);
    for (int i = 0; i < STATES; i++) N_VGetArrayPointer(tolerance)[i] = atol * TYPICAL[i];

    double least_s = INFINITY;
    long steps = 0, evaluations = 0;
    size_t written = 0;
    for (int repeat = 0; repeat < repeats; repeat++) {
        struct timespec begin, end;
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
        steps = evaluations = 0;
        written = 0;
        for (size_t at = 0; at < count;) {
            size_t rows = (size_t)tape[at++];
            memcpy(y, &tape[at], STATES * sizeof(double));
            at += STATES;
            const double *row = &tape[at];
            at += 4 * rows;
            Drive drive = {0};
            void *cvode = CVodeCreate(CV_BDF, context);
            check(CVodeInit(cvode, rates, 0.0, state), "CVodeInit");
            check(CVodeSVtolerances(cvode, rtol, tolerance), "CVodeSVtolerances");
            check(CVodeSetUserData(cvode, &drive), "CVodeSetUserData");
            check(CVodeSetLinearSolver(cvode, linear, matrix), "CVodeSetLinearSolver");
            check(CVodeSetJacFn(cvode, jacobian), "CVodeSetJacFn");
            check(CVodeSetMaxOrd(cvode, order), "CVodeSetMaxOrd");
            check(CVodeSetMaxNumSteps(cvode, 100000), "CVodeSetMaxNumSteps");
            double u_y = 0.0, t = 0.0, u_before = NAN, open_before = NAN;
            for (size_t j = 0;; j++) {
                out[written++] = y[X] / STROKE_Y;
                out[written++] = y[Z] / S;
                if (j + 1 == rows) break;
                double e = row[4 * j] - (closed ? y[Z] / S : row[4 * j + 3]);
                u_y = clamp(e >= 0.0005 ? 30.0 * e + 0.015 : e <= -0.0005 ? 30.0 * e - 0.015 : 0.0, -1.0, 1.0);
                drive.open = row[4 * j + 1];
                drive.p_s = row[4 * j + 2];
                for (int k = 1; k <= 10; k++) {
                    drive.u = clamp(8.0 * (u_y - y[X] / STROKE_Y), -1.0, 1.0);
                    double stop = 0.01 * (double)j + 0.001 * k;
                    int afresh = (restart && drive.u != u_before) || drive.open != open_before;
                    u_before = drive.u;
                    open_before = drive.open;
                    while (t < stop) {
                        if (afresh) {
                            long taken;
                            CVodeGetNumSteps(cvode, &taken);
                            steps += taken;
                            check(CVodeReInit(cvode, t, state), "CVodeReInit");
                        }
                        check(CVodeSetStopTime(cvode, stop), "CVodeSetStopTime");
                        check(CVode(cvode, stop, state, &t, CV_NORMAL), "CVode");
                        afresh = confine(y);
                    }
                    if (afresh) u_before = open_before = NAN;
                }
            }
            long taken;
            CVodeGetNumSteps(cvode, &taken);
            steps += taken;
            evaluations += drive.evaluations;
            CVodeFree(&cvode);
        }
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
        least_s = fmin(least_s, (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec));
    }
    FILE *file = fopen(argv[2], "wb");
    if (!file || fwrite(out, sizeof(double), written, file) != written || fclose(file)) return perror(argv[2]), 1;
    printf("%.9f %ld %ld\n", least_s, steps, evaluations);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(state);
    N_VDestroy(tolerance);
    SUNContext_Free(&context);
    free(tape);
    free(out);
    return 0;
}
