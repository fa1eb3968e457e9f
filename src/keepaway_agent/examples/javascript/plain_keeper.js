// A keeper in JavaScript, with rclnodejs: it goes to the ball, holds it, gets open.
'use strict';

const rclnodejs = require('rclnodejs');

const ACTION = rclnodejs.require('keepaway_msgs/msg/ActionRequest');
const LATCHED = new rclnodejs.QoS(
  rclnodejs.QoS.HistoryPolicy.RMW_QOS_POLICY_HISTORY_KEEP_LAST,
  1,
  rclnodejs.QoS.ReliabilityPolicy.RMW_QOS_POLICY_RELIABILITY_RELIABLE,
  rclnodejs.QoS.DurabilityPolicy.RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL
);

function choose(seen) {
  if (seen.ball_kickable) return ACTION.HOLD_BALL;
  const cycles = Array.from(seen.cycles_to_ball);
  const isFastest = cycles[seen.player_index] === Math.min(...cycles);
  return isFastest ? ACTION.GO_TO_BALL : ACTION.GET_OPEN;
}

async function main() {
  await rclnodejs.init(rclnodejs.Context.defaultContext(), process.argv);
  const node = new rclnodejs.Node('keeper_1');
  const name = node.name();
  const status = node.createPublisher('keepaway_msgs/msg/AgentStatus', `${name}/status`, { qos: LATCHED });
  const requests = node.createPublisher('keepaway_msgs/msg/ActionRequest', `${name}/action_request`);
  let index = 0;
  let numPlayers = 0;

  node.createSubscription('keepaway_msgs/msg/Match', 'match', { qos: LATCHED }, (match) => {
    index = match.player_names.indexOf(name);
    numPlayers = match.player_names.length;
    status.publish({
      player_index: index, name, policy: 'javascript', learning: false, ready: true,
      episodes: 0, simulated_hours: 0, code_version: '',
    });
  });
  node.createSubscription('keepaway_msgs/msg/Perception', `${name}/perception`, (seen) => {
    if (!seen.decision_due || seen.cycles_to_ball.length !== numPlayers) return;
    const { episode, cycle } = seen;
    requests.publish({
      player_index: index, episode, cycle, action: choose(seen), target: 0, action_values: [],
    });
  });
  for (const signal of ['SIGTERM', 'SIGINT']) {
    process.on(signal, () => { rclnodejs.shutdown(); process.exit(0); });
  }
  rclnodejs.spin(node);
}

main();
