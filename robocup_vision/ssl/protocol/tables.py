"""The league's messages as tables: what a field's number, name and type are; from these alone the messages are built.

A line of a message is its number, name and type; ``!`` marks a required field, ``[]`` a repeated one, ``packed`` a
repeated one in one piece, ``= x`` a default, ``oneof NAME`` a field that excludes its neighbours of that name. An
indented line of an enum lists its names and numbers. A type is looked for in its own table first, then in the others.
The names are the league's: whoever reads a dump of a message finds them there. All of it is proto2.
"""

# What cameras send: detections, and the geometry of field and cameras.
VISION = """
message SSL_DetectionBall
    1 confidence float!
    2 area uint32
    3 x float!
    4 y float!
    5 z float
    6 pixel_x float!
    7 pixel_y float!
message SSL_DetectionRobot
    1 confidence float!
    2 robot_id uint32
    3 x float!
    4 y float!
    5 orientation float
    6 pixel_x float!
    7 pixel_y float!
    8 height float
message SSL_DetectionFrame
    1 frame_number uint32!
    2 t_capture double!
    3 t_sent double!
    8 t_capture_camera double
    4 camera_id uint32!
    5 balls SSL_DetectionBall[]
    6 robots_yellow SSL_DetectionRobot[]
    7 robots_blue SSL_DetectionRobot[]
enum SSL_FieldShapeType
    Undefined=0 CenterCircle=1 TopTouchLine=2 BottomTouchLine=3 LeftGoalLine=4 RightGoalLine=5 HalfwayLine=6
    CenterLine=7 LeftPenaltyStretch=8 RightPenaltyStretch=9 LeftFieldLeftPenaltyStretch=10
    LeftFieldRightPenaltyStretch=11 RightFieldLeftPenaltyStretch=12 RightFieldRightPenaltyStretch=13
message Vector2f
    1 x float!
    2 y float!
message SSL_FieldLineSegment
    1 name string!
    2 p1 Vector2f!
    3 p2 Vector2f!
    4 thickness float!
    5 type SSL_FieldShapeType
message SSL_FieldCircularArc
    1 name string!
    2 center Vector2f!
    3 radius float!
    4 a1 float!
    5 a2 float!
    6 thickness float!
    7 type SSL_FieldShapeType
message SSL_GeometryFieldSize
    1 field_length int32!
    2 field_width int32!
    3 goal_width int32!
    4 goal_depth int32!
    5 boundary_width int32!
    16 boundary_width_goal_line int32
    6 field_lines SSL_FieldLineSegment[]
    7 field_arcs SSL_FieldCircularArc[]
    8 penalty_area_depth int32
    9 penalty_area_width int32
    10 center_circle_radius int32
    11 line_thickness int32
    12 goal_center_to_penalty_mark int32
    13 goal_height int32
    14 ball_radius float
    15 max_robot_radius float
    17 goal_substitution_area_width int32
message SSL_GeometryCameraCalibration
    1 camera_id uint32!
    2 focal_length float!
    3 principal_point_x float!
    4 principal_point_y float!
    5 distortion float!
    6 q0 float!
    7 q1 float!
    8 q2 float!
    9 q3 float!
    10 tx float!
    11 ty float!
    12 tz float!
    13 derived_camera_world_tx float
    14 derived_camera_world_ty float
    15 derived_camera_world_tz float
    16 pixel_image_width uint32
    17 pixel_image_height uint32
message SSL_BallModelStraightTwoPhase
    1 acc_slide double!
    2 acc_roll double!
    3 k_switch double!
message SSL_BallModelChipFixedLoss
    1 damping_xy_first_hop double!
    2 damping_xy_other_hops double!
    3 damping_z double!
message SSL_GeometryModels
    1 straight_two_phase SSL_BallModelStraightTwoPhase
    2 chip_fixed_loss SSL_BallModelChipFixedLoss
message SSL_GeometryData
    1 field SSL_GeometryFieldSize!
    2 calib SSL_GeometryCameraCalibration[]
    3 models SSL_GeometryModels
enum SSL_Source
    SSL_SOURCE_UNKNOWN=0 SSL_SOURCE_OTHER=1 SSL_SOURCE_SSL_VISION=2 SSL_SOURCE_VISION_PROCESSOR=3
    SSL_SOURCE_GRSIM=4 SSL_SOURCE_ERFORCE_SIM=5
message SSL_WrapperPacket
    1 detection SSL_DetectionFrame
    2 geometry SSL_GeometryData
    3 source SSL_Source
"""

# What trackers send: objects over all cameras, with velocities.
TRACKED = """
enum TeamColor
    TEAM_COLOR_UNKNOWN=0 TEAM_COLOR_YELLOW=1 TEAM_COLOR_BLUE=2
enum Capability
    CAPABILITY_UNKNOWN=0 CAPABILITY_DETECT_FLYING_BALLS=1 CAPABILITY_DETECT_MULTIPLE_BALLS=2
    CAPABILITY_DETECT_KICKED_BALLS=3
message Vector2
    1 x float!
    2 y float!
message Vector3
    1 x float!
    2 y float!
    3 z float!
message RobotId
    1 id uint32!
    2 team_color TeamColor!
message TrackedBall
    1 pos Vector3!
    2 vel Vector3
    3 visibility float
message KickedBall
    1 pos Vector2!
    2 vel Vector3!
    3 start_timestamp double!
    4 stop_timestamp double
    5 stop_pos Vector2
    6 robot_id RobotId
message TrackedRobot
    1 robot_id RobotId!
    2 pos Vector2!
    3 orientation float!
    4 vel Vector2
    5 vel_angular float
    6 visibility float
message TrackedFrame
    1 frame_number uint32!
    2 timestamp double!
    3 balls TrackedBall[]
    4 robots TrackedRobot[]
    5 kicked_ball KickedBall
    6 capabilities Capability[]
message TrackerWrapperPacket
    1 uuid string!
    2 source_name string
    3 tracked_frame TrackedFrame
"""

# What the game controller sends, and what it exchanges with a simulator. `GameEvent` and `Input` are kept unread.
REFEREE = """
enum Team
    UNKNOWN=0 YELLOW=1 BLUE=2
enum Division
    DIV_UNKNOWN=0 DIV_A=1 DIV_B=2
message RobotId
    1 id uint32
    2 team Team
message Vector2
    1 x float!
    2 y float!
message Vector3
    1 x float!
    2 y float!
    3 z float!
enum MatchType
    UNKNOWN_MATCH=0 GROUP_PHASE=1 ELIMINATION_PHASE=2 FRIENDLY=3
enum HullColor
    HULL_COLOR_UNKNOWN=0 HULL_COLOR_DARK=1 HULL_COLOR_LIGHT=2
message Referee
    18 source_identifier string
    19 match_type MatchType = UNKNOWN_MATCH
    1 packet_timestamp uint64!
    2 stage Referee.Stage!
    3 stage_time_left sint64
    4 command Referee.Command!
    5 command_counter uint32!
    6 command_timestamp uint64!
    7 yellow Referee.TeamInfo!
    8 blue Referee.TeamInfo!
    9 designated_position Referee.Point
    10 blue_team_on_positive_half bool
    12 next_command Referee.Command
    16 game_events GameEvent[]
    17 game_event_proposals GameEventProposalGroup[]
    15 current_action_time_remaining int64
    20 status_message string
enum Referee.Stage
    NORMAL_FIRST_HALF_PRE=0 NORMAL_FIRST_HALF=1 NORMAL_HALF_TIME=2 NORMAL_SECOND_HALF_PRE=3 NORMAL_SECOND_HALF=4
    EXTRA_TIME_BREAK=5 EXTRA_FIRST_HALF_PRE=6 EXTRA_FIRST_HALF=7 EXTRA_HALF_TIME=8 EXTRA_SECOND_HALF_PRE=9
    EXTRA_SECOND_HALF=10 PENALTY_SHOOTOUT_BREAK=11 PENALTY_SHOOTOUT=12 POST_GAME=13
enum Referee.Command
    HALT=0 STOP=1 NORMAL_START=2 FORCE_START=3 PREPARE_KICKOFF_YELLOW=4 PREPARE_KICKOFF_BLUE=5
    PREPARE_PENALTY_YELLOW=6 PREPARE_PENALTY_BLUE=7 DIRECT_FREE_YELLOW=8 DIRECT_FREE_BLUE=9
    INDIRECT_FREE_YELLOW=10 INDIRECT_FREE_BLUE=11 TIMEOUT_YELLOW=12 TIMEOUT_BLUE=13 GOAL_YELLOW=14 GOAL_BLUE=15
    BALL_PLACEMENT_YELLOW=16 BALL_PLACEMENT_BLUE=17
message Referee.TeamInfo
    1 name string!
    2 score uint32!
    3 red_cards uint32!
    4 yellow_card_times uint32 packed[]
    5 yellow_cards uint32!
    6 timeouts uint32!
    7 timeout_time uint32!
    8 goalkeeper uint32!
    9 foul_counter uint32
    10 ball_placement_failures uint32
    12 can_place_ball bool
    13 max_allowed_bots uint32
    14 bot_substitution_intent bool
    15 ball_placement_failures_reached bool
    16 bot_substitution_allowed bool
    17 bot_substitutions_left uint32
    18 bot_substitution_time_left uint32
    19 hull_color HullColor
message Referee.Point
    1 x float!
    2 y float!
message GameEventProposalGroup
    3 id string
    1 game_events GameEvent[]
    2 accepted bool
message CiInput
    1 timestamp int64
    2 tracker_packet TrackerWrapperPacket
    3 api_inputs Input[]
    4 geometry SSL_GeometryData
message CiOutput
    1 referee_msg Referee
message GameEvent
message Input
"""

# What a simulator takes and answers. `Any` is laid out as google.protobuf.Any; `RobotMotion` is this project's own.
SIMULATION = """
enum Team
    UNKNOWN=0 YELLOW=1 BLUE=2
enum Division
    DIV_UNKNOWN=0 DIV_A=1 DIV_B=2
message RobotId
    1 id uint32
    2 team Team
message SimulatorError
    1 code string
    2 message string
message RobotLimits
    1 acc_speedup_absolute_max float
    2 acc_speedup_angular_max float
    3 acc_brake_absolute_max float
    4 acc_brake_angular_max float
    5 vel_absolute_max float
    6 vel_angular_max float
message RobotWheelAngles
    1 front_right float!
    2 back_right float!
    3 back_left float!
    4 front_left float!
message RobotSpecs
    1 id RobotId!
    2 radius float = 0.09
    3 height float = 0.15
    4 mass float
    7 max_linear_kick_speed float
    8 max_chip_kick_speed float
    9 center_to_dribbler float
    10 limits RobotLimits
    13 wheel_angles RobotWheelAngles
    14 custom Any[]
message RealismConfig
    1 custom Any[]
message SimulatorConfig
    1 geometry SSL_GeometryData
    2 robot_specs RobotSpecs[]
    3 realism_config RealismConfig
    4 vision_port uint32
message TeleportBall
    1 x float
    2 y float
    3 z float
    4 vx float
    5 vy float
    6 vz float
    7 teleport_safely bool = false
    8 roll bool = false
    9 by_force bool = false
message TeleportRobot
    1 id RobotId!
    2 x float
    3 y float
    4 orientation float
    5 v_x float = 0
    6 v_y float = 0
    7 v_angular float = 0
    8 present bool
    9 by_force bool = false
message SimulatorControl
    1 teleport_ball TeleportBall
    2 teleport_robot TeleportRobot[]
    3 simulation_speed float
message SimulatorCommand
    1 control SimulatorControl
    2 config SimulatorConfig
message SimulatorResponse
    1 errors SimulatorError[]
message RobotCommand
    1 id uint32!
    2 move_command RobotMoveCommand
    3 kick_speed float
    4 kick_angle float = 0
    5 dribbler_speed float
message RobotMoveCommand
    1 wheel_velocity MoveWheelVelocity oneof command
    2 local_velocity MoveLocalVelocity oneof command
    3 global_velocity MoveGlobalVelocity oneof command
message MoveWheelVelocity
    1 front_right float!
    2 back_right float!
    3 back_left float!
    4 front_left float!
message MoveLocalVelocity
    1 forward float!
    2 left float!
    3 angular float!
message MoveGlobalVelocity
    1 x float!
    2 y float!
    3 angular float!
message RobotControl
    1 robot_commands RobotCommand[]
message RobotFeedback
    1 id uint32!
    2 dribbler_ball_contact bool
    3 custom Any
message RobotControlResponse
    1 errors SimulatorError[]
    2 feedback RobotFeedback[]
message SimulationSyncRequest
    1 sim_step float
    2 simulator_command SimulatorCommand
    3 robot_control RobotControl
message SimulationSyncResponse
    1 detection SSL_DetectionFrame[]
    2 robot_control_response RobotControlResponse
message RealismConfigErForce
    1 stddev_ball_p float
    2 stddev_robot_p float
    3 stddev_robot_phi float
    4 stddev_ball_area float
    5 enable_invisible_ball bool
    6 ball_visibility_threshold float
    7 camera_overlap float
    8 dribbler_ball_detections float
    9 camera_position_error float
    10 robot_command_loss float
    11 robot_response_loss float
    12 missing_ball_detections float
    13 vision_delay int64
    14 vision_processing_time int64
    15 simulate_dribbling bool
message RobotSpecErForce
    1 shoot_radius float
    3 dribbler_width float
message RobotMotion
    1 forward float
    2 left float
    3 angular float
message Any
    1 type_url string
    2 value bytes
"""

# What automatic referees and teams exchange with the game controller. The league has a message of its own for each
# event; those of one robot are laid out alike, and are `ByRobot` here: number 4 is the speed or the distance.
CONTROLLER = """
enum ControllerReply.StatusCode
    UNKNOWN_STATUS_CODE=0 OK=1 REJECTED=2
enum ControllerReply.Verification
    UNKNOWN_VERIFICATION=0 VERIFIED=1 UNVERIFIED=2
message ControllerReply
    1 status_code ControllerReply.StatusCode
    2 reason string
    3 next_token string
    4 verification ControllerReply.Verification
message Signature
    1 token string!
    2 pkcs1v15 bytes!
message AutoRefRegistration
    1 identifier string!
    2 signature Signature
message AutoRefToController
    1 signature Signature
    2 game_event GameEvent
message ControllerToAutoRef
    1 controller_reply ControllerReply oneof msg
enum AdvantageChoice
    STOP=0 CONTINUE=1
message TeamRegistration
    1 team_name string!
    2 signature Signature
    3 team Team
message TeamToController
    1 signature Signature
    2 desired_keeper int32 oneof msg
    3 advantage_choice AdvantageChoice oneof msg
    4 substitute_bot bool oneof msg
    5 ping bool oneof msg
message ControllerToTeam
    1 controller_reply ControllerReply oneof msg
enum Team
    UNKNOWN=0 YELLOW=1 BLUE=2
message Vector2
    1 x float!
    2 y float!
enum GameEvent.Type
    UNKNOWN_GAME_EVENT_TYPE=0 PLACEMENT_SUCCEEDED=5 BALL_LEFT_FIELD_TOUCH_LINE=6 BALL_LEFT_FIELD_GOAL_LINE=7
    ATTACKER_DOUBLE_TOUCHED_BALL=14 ATTACKER_TOUCHED_BALL_IN_DEFENSE_AREA=15 BOT_KICKED_BALL_TOO_FAST=18
    BOT_INTERFERED_PLACEMENT=20 BOT_TOO_FAST_IN_STOP=28 DEFENDER_TOO_CLOSE_TO_KICK_POINT=29
    DEFENDER_IN_DEFENSE_AREA=31 POSSIBLE_GOAL=39
message GameEvent
    50 id string
    40 type GameEvent.Type
    41 origin string[]
    49 created_timestamp uint64
    5 placement_succeeded PlacementSucceeded oneof event
    6 ball_left_field_touch_line ByRobot oneof event
    7 ball_left_field_goal_line ByRobot oneof event
    14 attacker_double_touched_ball ByRobot oneof event
    15 attacker_touched_ball_in_defense_area ByRobot oneof event
    18 bot_kicked_ball_too_fast ByRobot oneof event
    20 bot_interfered_placement ByRobot oneof event
    28 bot_too_fast_in_stop ByRobot oneof event
    29 defender_too_close_to_kick_point ByRobot oneof event
    31 defender_in_defense_area ByRobot oneof event
    39 possible_goal Goal oneof event
message ByRobot
    1 by_team Team!
    2 by_bot uint32
    3 location Vector2
    4 amount float
message PlacementSucceeded
    1 by_team Team!
    2 time_taken float
    3 precision float
    4 distance float
message Goal
    1 by_team Team!
    6 kicking_team Team
    2 kicking_bot uint32
    3 location Vector2
    4 kick_location Vector2
    5 max_ball_height float
    7 num_robots_by_team uint32
    8 last_touch_by_team uint64
    9 message string
"""

TABLES = {"vision": VISION, "tracked": TRACKED, "referee": REFEREE, "simulation": SIMULATION, "controller": CONTROLLER}
