"""The defaults of all public names: whoever relies on one finds out when it changes.

A default that changes changes results without a word, so it is changed here too, and CHANGELOG.md
says so. Defaults of None are not listed; one that is no longer None is.
"""

import inspect

import numpy as np

import emacm
import emacm.displays
import emacm.monitoring
import emacm.shaft
import emacm.simulation
import emacm.thesis

PACKAGES = (emacm, emacm.displays, emacm.monitoring, emacm.shaft, emacm.simulation, emacm.thesis)

DEFAULTS = {
    "Actuator": {
        "screw_lead": 0.1575,
        "efficiency": 0.9,
        "inertia": 0.0015,
        "coulomb": 0.4,
        "viscous": 0.001,
        "stiffness": 100000000.0,
        "winding_resistance": 0.25,
        "winding_inductance": 0.0015,
        "max_current": 40.0,
        "torque_gain": 1.0,
        "position_gain": 40.0,
        "velocity_bandwidth": 60.0,
        "ripple": 0.05,
        "cogging": 0.02,
        "unbalance": 4e-05,
        "waviness": 1.0,
        "recirculation": 0.01,
        "resolver_error": 3.0,
        "rolling_noise": 20.0,
        "housing_mass": 12.0,
        "resonance": 420.0,
        "damping": 0.04,
        "lvdt_gain": 1.0,
        "lvdt_offset": 0.0,
        "accelerometer_gain": 1.0,
        "phase_mismatch": 0.0,
        "electrical_noise": 1.0,
        "mark": 0.0,
    },
    "AlarmDisplay": {
        "two_sided": False,
        "name": "statistic",
        "time_label": "number of the reading",
    },
    "AlarmDisplay.from_estimator": {"column": 0},
    "BallScrew": {"contact_angle": np.pi / 4, "ratio": 1.0, "rotating": "screw", "name": ""},
    "Bearing": {"contact_angle": 0.0, "ratio": 1.0, "rotating": "inner", "name": ""},
    "BinTransformer": {"bin_size": 1.0, "max_order": 50.0, "stop_bands": ()},
    "CUSUM": {"reference": 0.5},
    "CUSUM.get_params": {"deep": True},
    "Chapter": {"opening": ""},
    "Chapter.compare": {"slack": 0.0},
    "ComparisonDisplay": {"scheme": ""},
    "ConditionRouter": {"condition": "load", "unseen": "raise"},
    "ContributionsDisplay": {"slip": 0.02, "decision": "the decision", "unit": "nats"},
    "CostSensitiveGaussianBayes": {"covariance": "full"},
    "DecisionRegionsDisplay": {"names": ("feature 1", "feature 2"), "healthy": "healthy"},
    "DecisionRegionsDisplay.from_estimator": {"n_grid": 300},
    "EWMA": {"weight": 0.2},
    "EWMA.get_params": {"deep": True},
    "EnvelopeDetector": {"squared": True},
    "EvaluationDisplay": {"scheme": "", "healthy": "healthy"},
    "ExplainedVarianceDisplay": {"n_shown": 20},
    "ExplainedVarianceDisplay.from_estimator": {"n_shown": 20},
    "Fault": {
        "orders": (),
        "rolls": False,
        "turns_with": 0.0,
        "torque": 0.0,
        "impact": 0.0,
        "force": 0.0,
        "rolling_noise": 0.0,
        "friction": 0.0,
        "friction_noise": 0.0,
        "imbalance": 0.0,
        "backlash": 0.0,
        "place": 0.0,
        "width": 1.0,
    },
    "FaultLines": {"harmonics": 3, "slip": 0.02, "background": 0.5},
    "FaultLinesDisplay": {"harmonics": 3, "slip": 0.02, "channel": "signal"},
    "FaultLinesDisplay.from_recording": {"harmonics": 3, "slip": 0.02, "revolutions": 25},
    "FeatureBaseline": {"condition": "load", "healthy": "normal"},
    "HealthIndex": {"false_alarm": 0.05, "min_baseline": 5},
    "InputAlarm": {"typicality": 0.01, "consecutive": 2, "unknown": "unknown"},
    "RemainingLife": {"model": "weibull", "coverage": 0.9, "consecutive": 3},
    "RemainingLifeDisplay": {"unit": "h", "coverage": 0.9},
    "WearLaw": {
        "onset_shape": 2.0,
        "onset_scale": 200.0,
        "start": 0.05,
        "drift": 0.03,
        "drift_spread": 0.008,
        "diffusion": 0.004,
    },
    "WearLaw.draw": {"observed": np.inf, "seed": 0},
    "alpha_lambda": {"alpha": 0.2, "fraction": 0.5},
    "coverage_by_unit": {"confidence": 0.95},
    "phm2012_lives": {"source": "official"},
    "prognostic_horizon": {"alpha": 0.1},
    "run_to_failure_fleet": {
        "interval": 10.0,
        "fault": "inner ring",
        "condition": 4,
        "censored": 0.0,
        "duration": 1.0,
        "fs": 4000.0,
        "seed": 0,
        "first_unit": 0,
    },
    "trendability": {"ranks": False},
    "TrendDisplay": {"time_label": "time"},
    "TrendDisplay.from_estimator": {"time_label": "time"},
    "Reading": {"alarms": (), "outside_training": ()},
    "vibration_velocity": {"unit": "m/s2", "band": (10.0, 1000.0)},
    "FeatureDensityDisplay": {
        "shares": (0.5, 0.9),
        "names": ("feature 1", "feature 2"),
        "healthy": "healthy",
    },
    "Gear": {"ratio": 1.0, "name": ""},
    "GearIndicators": {
        "shaft_orders": 2,
        "by_direction": "auto",
        "min_speed": 0.0,
        "min_revolutions": 0.0,
    },
    "InductionMotor": {"name": ""},
    "InductionMotor.from_speed": {"name": ""},
    "KurtogramDisplay": {"channel": "signal"},
    "KurtogramDisplay.from_signal": {"channel": "signal"},
    "LaboratoryBench": {
        "unit": 0,
        "electrical_noise": 1.0,
        "unit_spread": 1.0,
        "run_spread": 1.0,
        "phases": "a",
        "commands": False,
        "duration": 10.0,
        "fs": 48000.0,
        "cutoff": 15000.0,
        "seed": 0,
    },
    "LaboratoryBench.record": {"run": 1},
    "LaboratoryBench.truth": {"run": 1},
    "LoadingsDisplay.from_estimator": {"n_components": 2},
    "Motor": {"name": ""},
    "NewUnitClassifier": {"shrinkage": "auto"},
    "NewUnitClassifier.prediction_sets": {"coverage": 0.9},
    "OrderBinsDisplay": {
        "slip": 0.02,
        "unit": "unit",
        "healthy": "healthy",
        "scale": "dB",
        "stop_bands": (),
    },
    "OrderCrossSpectrum": {
        "revolutions": 16,
        "kind": "response",
        "form": "rectangular",
        "stop_bands": (),
        "window": "hann",
        "overlap": 0.5,
        "detrend": "constant",
        "by_direction": False,
        "short": "raise",
        "verbose": False,
    },
    "OrderMapDisplay": {
        "slip": 0.02,
        "over": "time",
        "n_speeds": 24,
        "channel": "signal",
        "unit": "unit",
    },
    "OrderMapDisplay.from_recording": {
        "theta_s": 2 * np.pi / 128,
        "revolutions": 4,
        "overlap": 0.5,
        "window": "hann",
        "direction": "strokes",
        "min_speed": 0.0,
    },
    "OrderMonitor": {"unit": "revolutions", "wrapped": False},
    "OrderPSD": {
        "revolutions": 16,
        "window": "hann",
        "overlap": 0.5,
        "detrend": "constant",
        "scaling": "density",
        "average": "mean",
        "by_direction": False,
        "short": "raise",
        "verbose": False,
    },
    "OrderResampler": {
        "theta_s": 2 * np.pi / 128,
        "interpolation": "cubic",
        "antialias": True,
        "direction": "strokes",
        "min_speed": 0.0,
        "ratio": 1.0,
        "reference_kind": "velocity",
    },
    "OrderSpectrumDisplay": {
        "slip": 0.02,
        "unit": "unit",
        "healthy": "healthy",
        "scale": "dB",
        "channel": "signal",
        "scaling": "density",
    },
    "OutcomesDisplay": {"show_n": True},
    "PlanetaryGear": {"fixed": "ring", "ratio": 1.0, "name": ""},
    "PosteriorProduct.get_params": {"deep": True},
    "Recording.cut": {"start": 0.0},
    "Recording.paths": {"direction": "strokes", "min_speed": 0.0},
    "Recording.strokes": {"min_speed": 0.0},
    "RecordingDisplay": {"strokes": ()},
    "RecordingDisplay.from_recording": {"shade_strokes": False, "min_speed": 0.0},
    "RecordingFolder": {"pattern": "**/*"},
    "RecordingStatistics": {
        "statistics": ("mean", "rms", "peak", "crest_factor", "kurtosis", "slope"),
        "by_direction": "auto",
        "min_speed": 0.0,
        "min_revolutions": 0.0,
        "sections": ("stroke",),
        "section_statistics": ("mean", "rms", "peak"),
        "transient": 0.5,
    },
    "ShaftHarmonics": {
        "orders": (1, 2),
        "by_direction": "auto",
        "phase": "absolute",
        "n_sections": 1,
        "min_speed": 0.0,
        "min_revolutions": 0.0,
    },
    "SignalBaseline": {"condition": "load", "healthy": "normal", "align": "angle"},
    "SignalCache": {"max_bytes": 268435456},
    "StrokeProfile": {
        "n_coefficients": 8,
        "by_direction": "auto",
        "basis": "cosine",
        "min_speed": 0.0,
        "min_revolutions": 0.0,
    },
    "SynchronousAverage": {"by_direction": "auto", "min_speed": 0.0, "min_revolutions": 0.0},
    "TypicalityDisplay": {"healthy": "healthy"},
    "UnknownRocDisplay": {"threshold": 0.01},
    "actuator_recipe": {
        "phase": False,
        "condition": "load",
        "unknown": "unknown",
        "temperature": "groups",
        "revolutions": 4,
        "max_order": 2.5,
        "min_speed": 0.0,
    },
    "angle_from_currents": {"weak": 0.05},
    "angle_from_pulses": {"pulses_per_rev": 1, "repair": True},
    "angle_from_resolver": {"pole_pairs": 1},
    "angle_from_tacho": {"pulses_per_rev": 1, "repair": True},
    "angle_from_velocity": {"initial": 0.0},
    "angle_from_wrapped": {"period": 2 * np.pi},
    "bearing_recipe": {"harmonics": 3, "slip": 0.02, "revolutions": 25, "min_speed": 0.0},
    "chapter3_motion": {"mean_speed": 20 * np.pi, "speed_frequency": 5.0},
    "chapter3_recording": {
        "label": "healthy",
        "run": 0,
        "sigma": 0.25,
        "seed": 0,
        "duration": 2.048,
        "fs": 2000.0,
        "mean_speed": 20 * np.pi,
        "speed_frequency": 5.0,
        "current_amplitude": 5.0,
        "current_order": 6.0,
        "supply_amplitude": 0.1,
        "supply_frequency": 100.0,
        "defect_amplitude": 0.1,
        "defect_orders": {"healthy": None, "defect 1": 3.125, "defect 2": 10.5},
        "reference": "velocity",
    },
    "chapter3_recordings": {
        "n_runs": 40,
        "sigma": 0.25,
        "seed": 0,
        "defect_orders": {"healthy": None, "defect 1": 3.125, "defect 2": 10.5},
    },
    "evaluate": {
        "n_splits": 10,
        "confidence": 0.95,
        "n_resamples": 2000,
        "random_state": 0,
        "verbose": False,
    },
    "family_costs": {"missed": 1.0, "false_alarm": 1.0},
    "fault_orders": {"harmonics": 1, "sidebands": 0, "signal": "vibration"},
    "find_faults": {"harmonics": 3, "slip": 0.02, "false_alarm": 0.01},
    "laboratory_recordings": {"conditions": (1, 2, 3, 4, 5), "n_runs": 20, "first_run": 1},
    "match_fault_orders": {"slip": 0.02, "min_width": 0.0, "harmonics": 1},
    "miss_rate_limit": {
        "rate": 0.01,
        "confidence": 0.95,
        "n_splits": 10,
        "n_resamples": 2000,
        "random_state": 0,
    },
    "order_bands": {"slip": 0.02, "min_width": 0.0, "on_overlap": "raise"},
    "prediction_sets": {"coverage": 0.9},
    "pulse_times": {"edge": "rising"},
    "reproduce": {"chapters": (2, 3, 4, 5), "quick": False, "overwrite": False},
    "reproduce_chapter2": {"quick": False},
    "reproduce_chapter3": {"quick": False},
    "reproduce_chapter4": {"quick": False},
    "reproduce_chapter5": {"quick": False},
    "run_campaign": {"n_runs": 20, "readings": ("thesis",), "keep": False},
    "simulate_actuator": {
        "state": "healthy",
        "severity": 0.5,
        "unit": 0,
        "run": 1,
        "condition": 4,
        "seed": 0,
        "duration": 6.0,
        "fs": 4000.0,
    },
    "simulate_fleet": {"severity": (0.3, 0.7), "seed": 0, "first_unit": 0},
    "spectral_kurtosis": {"n_per_segment": 256},
    "study": {"reading": "thesis", "channels": ("lvdt", "velocity", "current_a", "accelerometer")},
    "thesis_benches": {"severity": 0.5, "grease": 0.75, "electrical_noise": (1.0, 0.2)},
}


def defaults(call):
    """Return the defaults of a call by parameter, without None and without what is made anew."""
    stated = {name: p.default for name, p in inspect.signature(call).parameters.items()}
    left_out = (inspect.Parameter.empty, None)
    return {
        name: value
        for name, value in stated.items()
        if not any(value is other for other in left_out) and repr(value) != "<factory>"
    }


def public_calls():
    """Yield the public functions, classes and their own methods, by name."""
    for name, public in ((n, getattr(package, n)) for package in PACKAGES for n in package.__all__):
        if not callable(public):
            continue
        yield name, public
        for inner in dir(public) if inspect.isclass(public) else ():
            method = getattr(public, inner)
            own = str(getattr(method, "__module__", "")).startswith("emacm.")
            if own and callable(method) and not inner.startswith("_"):
                yield f"{name}.{inner}", method


def test_the_defaults_are_those_listed_here():
    found = {name: defaults(call) for name, call in public_calls()}
    found = {name: options for name, options in found.items() if options}
    new = {name: options for name, options in found.items() if name not in DEFAULTS}
    assert not new, f"add to the table: {new}"
    assert not DEFAULTS.keys() - found.keys(), "a name is gone: remove it from the table"
    for name, options in found.items():
        assert options == DEFAULTS[name], name
        kinds = {key: isinstance(value, bool) for key, value in options.items()}
        assert kinds == {key: isinstance(value, bool) for key, value in DEFAULTS[name].items()}
